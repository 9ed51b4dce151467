"""Activation of a muscle by its excitation. Report symbol: U for both, which it does not part."""

from limb_nodes.levels.contracts import law, register
from limb_nodes.levels.equation import equation


@register
@law("activation_dynamics", source="report: the activation follows the input at once")
@equation("none", "activation")
def none(excitation: float) -> float:
    """Activation (1) equal to the excitation."""
    return excitation
