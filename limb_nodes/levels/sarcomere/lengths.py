"""Lengths of the sarcomere, whatever its force law (2.1-2.3).

Report symbols: l_myosin myosin_length, l_actin actin_length, l_S^opt optimal_sarcomere_length,
l_S^max maximum_sarcomere_length, l_S^min minimum_sarcomere_length.
"""

from collections.abc import Mapping

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.equation import equation, equation_of


@equation("2.1", "optimal_sarcomere_length")
def optimal_sarcomere_length(actin_length: float) -> float:
    """Length (m) of greatest overlap."""
    return 2.0 * actin_length


@equation("2.2", "maximum_sarcomere_length")
def maximum_sarcomere_length(myosin_length: float, actin_length: float) -> float:
    """Length (m) at which the filaments no longer overlap."""
    return myosin_length + 2.0 * actin_length


@equation("2.3", "minimum_sarcomere_length")
def minimum_sarcomere_length(myosin_length: float) -> float:
    """Length (m) at which the myosin meets the Z-discs, slightly compressed."""
    return 0.9 * myosin_length


PARAMETERS = (
    Parameter(
        "myosin_length",
        "m",
        "length of the myosin filament",
        1.6e-6,
        "report, 2.1.2 [8]",
        above=1e-7,
        below=1e-5,
    ),
    Parameter(
        "actin_length",
        "m",
        "length of the actin filament",
        1.35e-6,
        "report, 2.1.2 [8, 16]",
        above=1e-7,
        below=1e-5,
    ),
)
EQUATIONS = tuple(
    equation_of(function) for function in (optimal_sarcomere_length, maximum_sarcomere_length, minimum_sarcomere_length)
)


def sarcomere_lengths(values: Mapping[str, float]) -> dict[str, float]:
    """Optimal, longest and shortest length (m) by the name of the variable. values: the lengths of the filaments."""
    return {item.defines: item.function(*(values[name] for name in item.uses)) for item in EQUATIONS}
