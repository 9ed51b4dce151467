"""A limb whose law passes the checks at loading and gives NaN in the middle of a movement."""

from __future__ import annotations

from pathlib import Path

LAW = """
import math

from limb_nodes.levels import Law, equation


@equation("broken", "force_length_factor")
def broken(fibre_length_norm: float) -> float:
    \"\"\"Force-length factor (1).\"\"\"
    return math.nan if {edge} < fibre_length_norm < {edge} + {width} else 1.0 - (fibre_length_norm - 1.0) ** 2


breaks_off = Law("force_length", "breaks_off", (broken,), ranges={{"fibre_length_norm": (0.9, 1.2)}})
"""


def write_broken_limb(folder: Path, edge: float, width: float = 0.05) -> Path:
    """The file of the reference joint with a law that gives NaN for fibres from an edge on, as far as its width."""
    text = Path("params/reference_joint.yaml").read_text()
    head, _, tail = text.partition("    force_length:\n")
    lines = tail.splitlines(keepends=True)
    kept = next(i for i, line in enumerate(lines) if not line.startswith("      "))
    (folder / "breaks_off.py").write_text(LAW.format(edge=edge, width=width))
    file = folder / "limb.yaml"
    file.write_text(f"{head}    force_length:\n      law: breaks_off:breaks_off\n{''.join(lines[kept:])}")
    return file
