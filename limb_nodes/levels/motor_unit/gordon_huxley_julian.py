"""Active force by sarcomere length from the overlap of the filaments, as straight lines.

Corners of the paper's figure 12, frog: no force at 1.27 um, 0.84 at 1.67 (myosin meets the
Z-discs), plateau from 2.00 (actin filaments meet) to 2.25 (end of the bare zone), no force at
3.65 (no overlap). With filaments of other lengths the corners move as overlap has it: the plateau
starts at twice the actin length (2.1), the force ends at 2.2, and the two corners of the compressed
sarcomere move with the myosin, whose length is the difference of 2.2 and 2.1.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law(
    "force_length",
    Parameter(
        "bare_zone",
        "m",
        "length of the myosin without heads, length of the plateau",
        0.25e-6,
        "Gordon, Huxley and Julian 1966, frog: 2.25 - 2.00 um",
        minimum=0.0,
        below=1e-5,
    ),
    Parameter(
        "shoulder",
        "1",
        "sarcomere length at which myosin meets the Z-discs, over the myosin length",
        1.67 / 1.65,
        "Gordon, Huxley and Julian 1966, frog: 1.67 um of 3.65 - 2.00 um",
        above=0.0,
        maximum=1.5,
    ),
    Parameter(
        "shoulder_force",
        "1",
        "factor at the shoulder",
        0.84,
        "Gordon, Huxley and Julian 1966, frog",
        minimum=0.0,
        maximum=1.0,
    ),
    Parameter(
        "collapse",
        "1",
        "sarcomere length below which there is no force, over the myosin length",
        1.27 / 1.65,
        "Gordon, Huxley and Julian 1966, frog: 1.27 um of 3.65 - 2.00 um",
        minimum=0.0,
        maximum=1.5,
    ),
    source="Gordon, Huxley and Julian, J Physiol 184 (1966) 170",
)
@equation("Gordon, Huxley, Julian, fig. 12", "force_length_factor")
def gordon_huxley_julian(
    sarcomere_length: float,
    optimal_sarcomere_length: float,
    maximum_sarcomere_length: float,
    bare_zone: float,
    shoulder: float,
    shoulder_force: float,
    collapse: float,
) -> float:
    """Force-length factor (1): straight lines with a plateau at full overlap."""
    myosin = maximum_sarcomere_length - optimal_sarcomere_length
    if sarcomere_length >= optimal_sarcomere_length:
        descent = (maximum_sarcomere_length - sarcomere_length) / (myosin - bare_zone)
        return max(0.0, min(1.0, descent))
    bend = shoulder * myosin
    if sarcomere_length >= bend:
        part = (sarcomere_length - bend) / (optimal_sarcomere_length - bend)
        return shoulder_force + (1.0 - shoulder_force) * part
    low = collapse * myosin
    return max(0.0, shoulder_force * (sarcomere_length - low) / (bend - low))
