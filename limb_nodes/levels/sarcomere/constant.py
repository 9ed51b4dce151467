"""A sarcomere whose force does not depend on its velocity, for tests of the levels above it."""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("maximum_force", "maximum_sarcomere_force")
def maximum_sarcomere_force(force: float) -> float:
    """Isometric force (N)."""
    return force


@equation("constant_force", "sarcomere_force")
def sarcomere_force(force: float) -> float:
    """Force (N), the same at every velocity."""
    return force


constant = register(
    Law(
        "sarcomere",
        "constant",
        (maximum_sarcomere_force, sarcomere_force),
        (Parameter("force", "N", "force of the sarcomere", 9.7778e-13, above=0.0),),
        source="report, 3.3.1: muscles of constant force",
    )
)
