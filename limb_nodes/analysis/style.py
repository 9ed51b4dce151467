"""How every picture looks, how it begins and how it is written."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from limb_nodes.errors import UserError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".pdf", ".svg")
# Okabe and Ito's colours and some of Tol's, which the colour-blind tell apart. Black and greys are for what belongs
# to joints or says how to read a picture.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#882255", "#332288", "#999933", "#8C564B")
STYLES = ("-", "--", ":", "-.")
BLACK, DARK, GREY, PALE, LIGHT, WHITE = "#000000", "#333333", "#666666", "#999999", "#E6E6E6", "#FFFFFF"
# Beside the figure, in points: of what explains a diagram, and of what labels many small things.
SMALL, TINY = 8, 5.5
_PARAMETERS: Any = {
    "font.size": 10,
    "figure.titlesize": 14,
    "figure.titleweight": "bold",
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.titlepad": 5,
    "axes.labelsize": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": LIGHT,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "svg.hashsalt": "limb",
    "pdf.fonttype": 42,
}
# Without them, the same picture has the same bytes.
_NO_DATES: dict[str, dict[str, None]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}, ".png": {}}

Given = ParamSpec("Given")
Result = TypeVar("Result")


def styled(draw: Callable[Given, Result]) -> Callable[Given, Result]:
    """Let a function draw in the style of all pictures."""

    @wraps(draw)
    def styled_draw(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        import matplotlib

        with matplotlib.rc_context(_PARAMETERS):
            return draw(*args, **kwargs)

    return styled_draw


def new_figure(width: float, height: float, title: str = "", fixed: bool = False) -> Figure:
    """An empty picture, inches wide and high, with a title at its upper left.

    fixed: its axes stay where they are put; otherwise they take what room their labels leave.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    engine = None if fixed else ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06, hspace=0.0, wspace=0.02)
    figure = Figure(figsize=(width, height), layout=engine)
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(title, x=0.012, ha="left")
    return figure


@styled
def save(figure: Figure, path: Path, dpi: float = 150.0) -> None:
    """Write a picture, whole or not at all; the kind of file follows from the name. Raises UserError."""
    part = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        figure.savefig(part, dpi=dpi, metadata=_NO_DATES[path.suffix.lower()])
        os.replace(part, path)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or " ".join(str(problem).split())
        raise UserError(f"{path}: cannot be written: {reason}") from None
    finally:
        part.unlink(missing_ok=True)
