"""A path of straight lines between points that are fixed on segments or on the base, over any number of joints.

A point has the coordinates x along its segment from the proximal joint and y across it, counter-clockwise. Those of the
base are counted from the first joint, along the direction in which the base runs on.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

from limb_nodes.foundation.parameter import Parameter
from limb_nodes.levels.derivative import written
from limb_nodes.levels.equation import Equation, Law
from limb_nodes.levels.muscle.spanning_path import LENGTH, spanning

SOURCE = "Delp, Loan, Hoy, Zajac, Topp and Rosen, IEEE Trans Biomed Eng 37 (1990) 757: straight lines between points"
COORDINATE = Parameter("at", "m", "of a point, along its segment and across it", minimum=-100.0, maximum=100.0)
SEGMENT_LENGTH = Parameter("segment_length", "m", "of a segment that the path passes", minimum=0.0, maximum=100.0)


@lru_cache(maxsize=256)
def straight(places: tuple[int, ...]) -> Law:
    """The law through points, each on a segment: 0 for that before the muscle's first joint, then 1, 2, ...

    Its parameters are x_0, y_0, x_1, ... of the points and segment_length_0, ...: of each segment up to the last joint.
    """
    joints = max(places)
    angles = tuple(f"joint_angle_{place}" for place in range(joints))
    coordinates = [f"{axis}_{number}" for number in range(len(places)) for axis in ("x", "y")]
    lengths = [f"segment_length_{place}" for place in range(joints)]
    lines = ["length = 0.0"]
    for (one, near), (other, far) in pairwise(enumerate(places)):
        start, end = (one, other) if near <= far else (other, one)
        lines += [f"x = x_{end}", f"y = y_{end}"]
        for joint in range(max(near, far) - 1, min(near, far) - 1, -1):
            lines += [
                f"cosine = math.cos(joint_angle_{joint})",
                f"sine = math.sin(joint_angle_{joint})",
                "along = x",
                f"x = cosine * along - sine * y + segment_length_{joint}",
                "y = sine * along + cosine * y",
            ]
        lines += [f"x = x - x_{start}", f"y = y - y_{start}", "length = length + math.sqrt(x * x + y * y)"]
    body = "".join(f"    {line}\n" for line in [*lines, "return length"])
    text = f"def muscle_tendon_length({', '.join((*angles, *coordinates, *lengths))}):\n{body}"
    of_points = (replace(COORDINATE, name=name) for name in coordinates)
    of_segments = (replace(SEGMENT_LENGTH, name=name) for name in lengths)
    equation = Equation("straight lines", LENGTH, written("muscle_tendon_length", text))
    return spanning(Law("path", "straight_lines", (equation,), (*of_points, *of_segments), source=SOURCE), angles)
