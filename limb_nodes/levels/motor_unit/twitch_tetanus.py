"""Active force by stimulation frequency, from that of single twitches to the tetanus.

A unit that has just been recruited twitches: its mean force is a share of its tetanus, and not 0 as 2.23 has it.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.bent_rise import bent_rise
from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Law, equation


@equation("twitch to tetanus", "force_frequency_factor")
def force_frequency_factor(
    stimulation_frequency: float,
    minimum_frequency: float,
    maximum_frequency: float,
    twitch_ratio: float,
    steepness: float,
) -> float:
    """Force-frequency factor (1): rises from the twitch's share at the lowest frequency to 1 at the greatest.

    The rise is (1 - exp(-s x))/(1 - exp(-s)) over the range of frequencies, 0 to 1; straight if s is 0.
    """
    if stimulation_frequency <= 0.0:
        return 0.0
    part = (stimulation_frequency - minimum_frequency) / (maximum_frequency - minimum_frequency)
    if part <= 0.0:
        # Below the lowest frequency single twitches follow each other more slowly.
        return twitch_ratio * stimulation_frequency / minimum_frequency
    return twitch_ratio + (1.0 - twitch_ratio) * bent_rise(part, -steepness)


twitch_tetanus = register(
    Law(
        "force_frequency",
        "twitch_tetanus",
        (force_frequency_factor,),
        (
            Parameter(
                "twitch_ratio",
                "1",
                "mean force at the lowest frequency over that of the tetanus",
                0.2,
                "estimate, near that of human thenar units (Thomas et al., J Neurophysiol 65 (1991) 1509)",
                minimum=0.0,
                maximum=0.9,
            ),
            Parameter(
                "steepness",
                "1",
                "how much faster the force rises at low frequencies, s; 0: evenly",
                0.0,
                "estimate",
                minimum=0.0,
                maximum=20.0,
            ),
        ),
        source="twitch over tetanus as measured; the curve between them is an estimate",
    )
)
