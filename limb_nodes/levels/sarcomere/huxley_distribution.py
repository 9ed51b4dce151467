"""Huxley's two-state cross-bridges, their whole distribution on a grid of bins.

Of the sites at the bond length x, in units of the reach h, the share n has a bond:
dn/dt = f(x) (1 - n) - g(x) n + u dn/dx, with the rates of `limb_nodes.levels.sarcomere.bond_moments`, which Zahalak's
moments approximate. Finite volumes: each bin has the mean share of its sites; bonds pass its edges with the velocity
u, upwind, at a share that a limited slope (van Albada, van Leer and Roberts, Astron Astrophys 108 (1982) 76) gives.
Edges stand where f and g jump, at 0 and 1; to both sides the bins grow wider.

Symbols: n bonds, u bond_velocity, f_1 attachment, g_1 detachment, g_2 release, g_3 overstretch, h reach.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from limb_nodes.levels.contracts import register
from limb_nodes.levels.equation import Equation, Law, State, equation, equation_of
from limb_nodes.levels.sarcomere.huxley import bond_velocity, huxley, maximum_sarcomere_force

BEHIND = tuple(f"behind_{k}" for k in range(12, 0, -1))
WITHIN = tuple(f"within_{k}" for k in range(1, 13))
BEYOND = tuple(f"beyond_{k}" for k in range(1, 13))
BINS = BEHIND + WITHIN + BEYOND


# The grid


@equation("bin, within", "bin_width")
def width_within() -> float:
    """Width (1) of the bins between 0 and 1."""
    return 1.0 / 12.0


@equation("bin, outside", "bin_width")
def width_outside(bin_width: float) -> float:
    """Width (1) of a bin outside 0 to 1, from that of its neighbour inwards."""
    return 1.2 * bin_width


@equation("first edge", "bin_edge")
def first_edge() -> float:
    """Bond length (1) at which the bins within begin."""
    return 0.0


@equation("edge, upwards", "bin_edge")
def edge_above(bin_edge: float, bin_width: float) -> float:
    """Lower edge (1) of a bin, from the edge and width of the bin below."""
    return bin_edge + bin_width


@equation("edge, downwards", "bin_edge")
def edge_below(bin_edge: float, bin_width: float) -> float:
    """Lower edge (1) of a bin of that width, from the edge of the bin above."""
    return bin_edge - bin_width


@equation("centre", "bin_centre")
def bin_centre(bin_edge: float, bin_width: float) -> float:
    """Mean bond length (1) of a bin."""
    return bin_edge + 0.5 * bin_width


# Bonds made and broken


@equation("f", "bin_attachment")
def attachment_within(attachment: float, bin_centre: float) -> float:
    """Mean rate (1/s) at which bonds are made in a bin between 0 and 1."""
    return attachment * bin_centre


@equation("f, outside", "bin_attachment")
def attachment_outside() -> float:
    """No bonds (1/s) are made outside 0 to 1."""
    return 0.0


@equation("g, behind", "bin_detachment")
def detachment_behind(release: float) -> float:
    """Rate (1/s) at which bonds break that pull backwards."""
    return release


@equation("g, within", "bin_detachment")
def detachment_within(detachment: float, bin_centre: float) -> float:
    """Mean rate (1/s) at which bonds break in a bin between 0 and 1."""
    return detachment * bin_centre


@equation("g, beyond", "bin_detachment")
def detachment_beyond(detachment: float, overstretch: float, bin_centre: float) -> float:
    """Mean rate (1/s) at which bonds break in a bin beyond the reach."""
    return detachment * bin_centre + overstretch * (bin_centre - 1.0)


# Bonds that pass the edges


@equation("limited slope", "bin_slope")
def limited_slope(
    bonds_below: float, bonds: float, bonds_above: float, centre_below: float, centre: float, centre_above: float
) -> float:
    """Slope (1) of the share within a bin: between those to both neighbours, 0 at a crest."""
    before = (bonds - bonds_below) / (centre - centre_below)
    behind = (bonds_above - bonds) / (centre_above - centre)
    product = before * behind
    if product <= 0.0:
        return 0.0
    return product * (before + behind) / (before * before + behind * behind)


@equation("no slope", "bin_slope")
def no_slope() -> float:
    """The outermost bins are flat (1)."""
    return 0.0


@equation("flux", "bin_flux")
def bin_flux(
    bond_velocity: float,
    bonds_below: float,
    slope_below: float,
    width_below: float,
    bonds: float,
    slope: float,
    width: float,
) -> float:
    """Bonds (1/s) that pass from a bin to that below."""
    if bond_velocity > 0.0:
        return bond_velocity * (bonds - 0.5 * slope * width)
    return bond_velocity * (bonds_below + 0.5 * slope_below * width_below)


@equation("flux, lower end", "bin_flux")
def flux_out_below(bond_velocity: float, bonds: float) -> float:
    """Bonds (1/s) that leave the lowest bin; none come in."""
    return max(0.0, bond_velocity) * bonds


@equation("flux, upper end", "bin_flux")
def flux_out_above(bond_velocity: float, bonds: float) -> float:
    """Bonds (1/s) that come into the highest bin from above: none, but some leave."""
    return min(0.0, bond_velocity) * bonds


@equation("dn/dt", "bonds_rate")
def bonds_rate(
    bonds: float,
    bin_attachment: float,
    bin_detachment: float,
    flux_from_above: float,
    flux_to_below: float,
    bin_width: float,
) -> float:
    """Rate (1/s) of the share of a bin's sites that have a bond."""
    return bin_attachment * (1.0 - bonds) - bin_detachment * bonds + (flux_from_above - flux_to_below) / bin_width


# Force


@equation("pull, none", "pull")
def no_pull() -> float:
    """The summed length (1) of no bonds."""
    return 0.0


@equation("pull", "pull")
def pull(pull: float, bonds: float, bin_slope: float, bin_centre: float, bin_width: float) -> float:
    """Summed length (1) of the bonds up to this bin."""
    return pull + bin_width * (bonds * bin_centre + bin_slope * bin_width * bin_width / 12.0)


@equation("n, isometric", "isometric_bonds")
def isometric_bonds(attachment: float, detachment: float) -> float:
    """Share (1) of the sites between 0 and 1 with a bond in isometry, f/(f + g)."""
    return attachment / (attachment + detachment)


@equation("n, start", "initial_share")
def initial_share(initial_bonds: float, isometric_bonds: float) -> float:
    """Share (1) of the sites between 0 and 1 with a bond at the start."""
    return min(1.0, initial_bonds * isometric_bonds)


@equation("n, start, outside", "no_bonds")
def no_bonds() -> float:
    """Share (1) of the sites outside 0 to 1 with a bond at the start."""
    return 0.0


@equation("pull to force", "sarcomere_force")
def sarcomere_force(pull: float, isometric_bonds: float, maximum_force: float) -> float:
    """Force (N): the bonds are springs, so it goes with their summed length."""
    return maximum_force * pull / (0.5 * isometric_bonds)


def at(function: object, place: str, **named: str) -> Equation:
    """An equation of a bin or of its lower edge; named: the quantities of other bins that it uses, by argument."""
    one: Equation = equation_of(function)  # type: ignore[arg-type]
    own = {"bonds", "bin_width", "bin_edge", "bin_centre", "bin_slope", "bin_attachment", "bin_detachment"}
    uses = (named.get(name, f"{name}_{place}" if name in own else name) for name in one.arguments)
    return replace(one, defines=f"{one.defines}_{place}", named=tuple(uses))


def grid() -> Iterator[Equation]:
    """Widths, edges and centres of the bins, from 0 to 1 outwards."""
    for place in WITHIN:
        yield at(width_within, place)
    for inner, outer in (*pairwise((WITHIN[-1], *BEYOND)), *pairwise((WITHIN[0], *BEHIND[::-1]))):
        yield at(width_outside, outer, bin_width=f"bin_width_{inner}")
    yield at(first_edge, WITHIN[0])
    for below, above in pairwise(WITHIN + BEYOND):
        yield at(edge_above, above, bin_edge=f"bin_edge_{below}", bin_width=f"bin_width_{below}")
    for above, below in pairwise((WITHIN[0], *BEHIND[::-1])):
        yield at(edge_below, below, bin_edge=f"bin_edge_{above}")
    for place in BINS:
        yield at(bin_centre, place)


def exchange() -> Iterator[Equation]:
    """How fast bonds are made and broken in each bin."""
    for place in BINS:
        yield at(attachment_within if place in WITHIN else attachment_outside, place)
    for places, detachment in (BEHIND, detachment_behind), (WITHIN, detachment_within), (BEYOND, detachment_beyond):
        for place in places:
            yield at(detachment, place)


def movement() -> Iterator[Equation]:
    """How bonds pass from bin to bin, and the rates that follow."""
    yield at(no_slope, BINS[0])
    for below, place, above in zip(BINS, BINS[1:], BINS[2:], strict=False):
        neighbours = {
            "bonds_below": f"bonds_{below}", "bonds_above": f"bonds_{above}", "centre": f"bin_centre_{place}",
            "centre_below": f"bin_centre_{below}", "centre_above": f"bin_centre_{above}",
        }  # fmt: skip
        yield at(limited_slope, place, **neighbours)
    yield at(no_slope, BINS[-1])
    yield at(flux_out_below, BINS[0])
    for below, place in pairwise(BINS):
        sides = {
            "bonds_below": f"bonds_{below}", "slope_below": f"bin_slope_{below}", "width_below": f"bin_width_{below}",
            "slope": f"bin_slope_{place}", "width": f"bin_width_{place}",
        }  # fmt: skip
        yield at(bin_flux, place, **sides)
    yield at(flux_out_above, "end", bonds=f"bonds_{BINS[-1]}")
    for place, above in pairwise((*BINS, "end")):
        yield at(bonds_rate, place, flux_from_above=f"bin_flux_{above}", flux_to_below=f"bin_flux_{place}")


def sums() -> Iterator[Equation]:
    """The bonds' summed length, bin by bin."""
    yield at(no_pull, "below")
    for below, place in pairwise(("below", *BINS)):
        yield at(pull, place, pull=f"pull_{below}")


huxley_distribution = register(
    Law(
        "sarcomere",
        "huxley_distribution",
        (
            maximum_sarcomere_force,
            isometric_bonds,
            initial_share,
            no_bonds,
            *grid(),
            *exchange(),
            bond_velocity,
            *movement(),
            *sums(),
            replace(equation_of(sarcomere_force), named=(f"pull_{BINS[-1]}", "isometric_bonds", "maximum_force")),
        ),
        huxley.parameters,
        states=tuple(
            State(
                f"bonds_{place}",
                f"bonds_rate_{place}",
                "dn/dt",
                "initial_share" if place in WITHIN else "no_bonds",
                0.5,
            )
            for place in BINS
        ),
        ranges={f"bonds_{place}": (0.0, 1.0) for place in BINS},
        source="Huxley, Prog Biophys 7 (1957) 255, with the rates of Zahalak, Math Biosci 55 (1981) 89",
    )
)
