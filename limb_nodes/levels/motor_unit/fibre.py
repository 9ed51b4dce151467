"""The motor unit around its laws: from the muscle's fibre to the sarcomere and back (2.13-2.25).

Report symbols: l_F fibre_length, v_F fibre_velocity, f_F stimulation_frequency, F_F fibre_force,
N_s series_sarcomeres, N_p parallel_sarcomeres, l_S sarcomere_length, v_S sarcomere_velocity,
f_S sarcomere_frequency, l_F^opt/max/min optimal/maximum/minimum_fibre_length,
F_F^max maximum_fibre_force, l_F^norm fibre_length_norm, f_F^norm frequency_norm,
FL force_length_factor, FF force_frequency_factor, F_PE passive_force_factor,
F_PE^max maximum_passive_force, f_min/f_max minimum/maximum_frequency.
"""

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.equation import equation, equation_of


@equation("2.13", "sarcomere_length")
def sarcomere_length(fibre_length: float, series_sarcomeres: float) -> float:
    """Length of one sarcomere (m)."""
    return fibre_length / series_sarcomeres


@equation("2.14", "sarcomere_velocity")
def sarcomere_velocity(fibre_velocity: float, series_sarcomeres: float) -> float:
    """Shortening velocity of one sarcomere (m/s)."""
    return fibre_velocity / series_sarcomeres


@equation("2.15", "sarcomere_frequency")
def sarcomere_frequency(stimulation_frequency: float) -> float:
    """Stimulation frequency of a sarcomere (Hz)."""
    return stimulation_frequency


@equation("2.16", "optimal_fibre_length")
def optimal_fibre_length(series_sarcomeres: float, optimal_sarcomere_length: float) -> float:
    """Fibre length of greatest force (m)."""
    return series_sarcomeres * optimal_sarcomere_length


@equation("2.17", "maximum_fibre_length")
def maximum_fibre_length(series_sarcomeres: float, maximum_sarcomere_length: float) -> float:
    """Fibre length at which no filaments overlap (m)."""
    return series_sarcomeres * maximum_sarcomere_length


@equation("2.18", "minimum_fibre_length")
def minimum_fibre_length(series_sarcomeres: float, minimum_sarcomere_length: float) -> float:
    """Shortest fibre length (m)."""
    return series_sarcomeres * minimum_sarcomere_length


@equation("2.19", "maximum_fibre_force")
def maximum_fibre_force(parallel_sarcomeres: float, maximum_sarcomere_force: float) -> float:
    """Greatest isometric active force of the unit (N)."""
    return parallel_sarcomeres * maximum_sarcomere_force


@equation("2.20", "fibre_length_norm")
def fibre_length_norm(
    fibre_length: float,
    minimum_fibre_length: float,
    optimal_fibre_length: float,
    maximum_fibre_length: float,
) -> float:
    """Normalised fibre length (1): 0 shortest (and below), 1 optimal, 2 longest."""
    if fibre_length <= optimal_fibre_length:
        return max(
            0.0,
            (fibre_length - minimum_fibre_length) / (optimal_fibre_length - minimum_fibre_length),
        )
    return (fibre_length - optimal_fibre_length) / (maximum_fibre_length - optimal_fibre_length) + 1.0


@equation("2.21", "frequency_norm")
def frequency_norm(stimulation_frequency: float, minimum_frequency: float, maximum_frequency: float) -> float:
    """Normalised stimulation frequency (1); 0 for a unit that is not recruited."""
    if stimulation_frequency <= 0.0:
        return 0.0
    return (stimulation_frequency - minimum_frequency) / (maximum_frequency - minimum_frequency)


@equation("2.25", "fibre_force")
def fibre_force(
    sarcomere_force: float,
    parallel_sarcomeres: float,
    force_length_factor: float,
    force_frequency_factor: float,
    passive_force_factor: float,
    maximum_passive_force: float,
) -> float:
    """Force of the unit along its fibres (N)."""
    return (
        sarcomere_force * parallel_sarcomeres * force_length_factor * force_frequency_factor
        + passive_force_factor * maximum_passive_force
    )


PARAMETERS = (
    Parameter(
        "series_sarcomeres",
        "1",
        "number of sarcomeres in series, N_s",
        source="depends on the muscle",
        minimum=1.0,
        maximum=1e7,
    ),
    Parameter(
        "parallel_sarcomeres",
        "1",
        "number of sarcomeres in parallel, N_p",
        source="depends on the muscle",
        minimum=1.0,
        maximum=1e18,
    ),
    Parameter(
        "minimum_frequency",
        "Hz",
        "stimulation frequency at recruitment, f_min",
        source="depends on the muscle",
        above=0.0,
        maximum=1000.0,
    ),
    Parameter(
        "maximum_frequency",
        "Hz",
        "greatest stimulation frequency, f_max",
        source="depends on the muscle",
        above=0.0,
        maximum=1000.0,
    ),
    Parameter(
        "pcsa",
        "m^2",
        "physiological cross-sectional area of the unit, PCSA_F",
        source="depends on the muscle",
        above=0.0,
        below=1.0,
    ),
    Parameter(
        "maximum_passive_force",
        "N",
        "passive force at the longest fibre length, F_PE^max",
        source="depends on the muscle",
        minimum=0.0,
        maximum=1e6,
    ),
)
EQUATIONS = tuple(
    equation_of(function)
    for function in (
        sarcomere_length,
        sarcomere_velocity,
        sarcomere_frequency,
        optimal_fibre_length,
        maximum_fibre_length,
        minimum_fibre_length,
        maximum_fibre_force,
        fibre_length_norm,
        frequency_norm,
        fibre_force,
    )
)
