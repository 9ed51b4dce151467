"""Muscles as lines for RViz and Foxglove, coloured by what they do."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb
from limb_nodes.model.lines import maximum_force, muscle_lines
from limb_nodes.solve.outputs import LENGTHS, MUSCLE_OUTPUTS
from limb_nodes.solve.ranges import limits

COLOURINGS = ("force", "activation")
# Red, green and blue, from a muscle that does nothing to one that does all it can, by its share. Most movements need
# little: half way lies low.
SHARES = (0.0, 0.3, 1.0)
COLOURS = ((0.16, 0.93, 0.95), (0.32, 0.80, 0.10), (0.75, 0.35, 0.05))
# Of a muscle with a length out of its range.
OUT_OF_RANGE = (0.95, 0.10, 0.90)
WIDTH = 0.008
# Times as wide: a muscle out of its range is to be seen without colours too.
EMPHASIS = 2.5
PLACES = [MUSCLE_OUTPUTS.index(name) for name in LENGTHS]
FORCE, ACTIVATION = MUSCLE_OUTPUTS.index("muscle_force"), MUSCLE_OUTPUTS.index("activation")


class Markers:
    """The lines of a limb's muscles.

    colouring: by the share of "force" or of "activation"; muscles whose greatest force is not known have the latter.
    """

    def __init__(self, limb: Limb, colouring: str) -> None:
        self._limb = limb
        self._allowed = [limits(muscle) for muscle in limb.muscles]
        self._force = [maximum_force(muscle) if colouring == "force" else math.nan for muscle in limb.muscles]

    def message(self, header: Header, angle: FloatArray, outputs: FloatArray) -> MarkerArray:
        """A line for each muscle, in the frame of the base.

        angle: of the joints (rad). outputs: what the muscles show [muscles, MUSCLE_OUTPUTS].
        """
        lines = muscle_lines(self._limb, angle.tolist())
        markers = []
        for number, name in enumerate(self._limb.muscle_names):
            if name not in lines:
                continue
            colour, width = self.look(number, outputs[number])
            marker = Marker(header=header, ns=name, type=Marker.LINE_STRIP, action=Marker.ADD, color=colour)
            marker.pose.orientation.w = 1.0
            marker.scale.x = width
            marker.points = [Point(x=x, y=y) for x, y in lines[name]]
            markers.append(marker)
        return MarkerArray(markers=markers)

    def look(self, number: int, outputs: FloatArray) -> tuple[ColorRGBA, float]:
        """Colour and width (m) of a muscle by its number."""
        low, high = self._allowed[number].T
        lengths = outputs[PLACES]
        if not ((low <= lengths) & (lengths <= high)).all():
            return colour_of(OUT_OF_RANGE), WIDTH * EMPHASIS
        full = self._force[number]
        share = float(outputs[ACTIVATION]) if math.isnan(full) else float(outputs[FORCE]) / full
        return colour_of([float(np.interp(share, SHARES, values)) for values in COLOURS]), WIDTH


def colour_of(parts: Sequence[float]) -> ColorRGBA:
    """An opaque colour of red, green and blue."""
    red, green, blue = parts
    return ColorRGBA(r=red, g=green, b=blue, a=1.0)
