"""The limb drawn at a few instants: segments, joints, tip, muscles, and where gravity points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from limb_nodes.analysis.plot.panels import look_of
from limb_nodes.analysis.plot.series import BagSeries, Series
from limb_nodes.analysis.style import DARK, GREY, LIGHT, WHITE
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb
from limb_nodes.model.lines import muscle_lines
from limb_nodes.model.points import points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BONE, HELD, GHOST, JOINT = GREY, "#BBBBBB", LIGHT, WHITE
# Part of the limb's reach that is drawn of what holds the base, if no muscle comes from further away.
BASE = 0.12


@dataclass(frozen=True)
class Posture:
    """The limb at an instant: bones [joints and tip, 2] in m, muscles [points, 2] with their activation."""

    time: float
    bones: FloatArray
    base: FloatArray
    muscles: tuple[tuple[str, FloatArray, float], ...]


def instants(angle: Series, count: int) -> list[int]:
    """Samples to draw: the first and the last, then each time the one that differs most in posture and time."""
    size = len(angle.times)
    if size <= count:
        return list(range(size))
    # Every millisecond of an hour is not needed to find a few postures.
    tried = np.unique(np.linspace(0, size - 1, min(size, 2000)).astype(np.intp))
    span = np.ptp(angle.times[tried])
    turned = np.ptp(angle.values[tried], axis=0).max()
    place = np.column_stack([angle.times[tried] / (span or 1.0), 0.5 * angle.values[tried] / (turned or 1.0)])
    chosen = [0, len(tried) - 1]
    while len(chosen) < count:
        distance = np.min([np.linalg.norm(place - place[i], axis=1) for i in chosen], axis=0)
        chosen.append(int(distance.argmax()))
    return sorted(int(tried[i]) for i in set(chosen))


def posture(run: BagSeries, limb: Limb, sample: int) -> Posture:
    """The limb at a sample of the angles."""
    assert run.angle is not None
    time = float(run.angle.times[sample])
    angle = np.array([run.angle.column(name)[sample] for name in limb.joint_names])
    # Points alternate: joint, centre of mass, joint, ..., tip.
    bones = np.array(points(limb, list(angle))[::2])
    drawn, reach = [], BASE * sum(segment.length for segment in limb.segments)
    for name, line in muscle_lines(limb, list(angle)).items():
        path = np.array(line)
        drawn.append((name, path, _activation(run, name, time)))
        if limb.muscles[limb.muscle_names.index(name)].joints[0] == 0:
            reach = max(reach, float(np.linalg.norm(path[0] - bones[0])))
    base = np.array([bones[0] - reach * _unit(limb.base_angle), bones[0]])
    return Posture(time, bones, base, tuple(drawn))


def frame(postures: list[Posture]) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of what the postures take, with a margin."""
    every = np.concatenate([np.concatenate([p.bones, p.base, *(path for _, path, _ in p.muscles)]) for p in postures])
    low, high = every.min(axis=0), every.max(axis=0)
    margin = 0.06 * float((high - low).max())
    return low[0] - margin, high[0] + margin, low[1] - margin, high[1] + margin


def draw_limb(axes: Axes, limb: Limb, shown: Posture, others: list[Posture]) -> None:
    """Draw one posture, the others pale behind it."""
    for other in others:
        axes.plot(*other.bones.T, color=GHOST, linewidth=2.5, solid_capstyle="round", zorder=1)
    axes.plot(*shown.base.T, color=HELD, linewidth=7, solid_capstyle="butt", zorder=2, gid="base")
    axes.plot(
        *shown.bones.T, color=BONE, linewidth=5, solid_capstyle="round", solid_joinstyle="round", zorder=3, gid="bones"
    )
    names = limb.muscle_names
    # The longest first, so that it does not cover the shorter ones along the same bone.
    for name, path, activation in sorted(shown.muscles, key=lambda one: -float(np.linalg.norm(one[1][0] - one[1][1]))):
        colour, _ = look_of(names.index(name))
        axes.plot(*path.T, color=colour, linewidth=1.2 + 3.0 * activation, solid_joinstyle="round", zorder=4, gid=name)
    axes.plot(*shown.bones[:-1].T, "o", color=JOINT, markeredgecolor=DARK, markeredgewidth=1.5, markersize=6, zorder=5)
    axes.plot(*shown.bones[-1], "o", color=DARK, markersize=5, zorder=5)


def draw_gravity(axes: Axes, gravity: tuple[float, float]) -> None:
    """An arrow along gravity, of the same length whatever its strength; nothing without gravity."""
    strength = float(np.hypot(*gravity))
    if strength == 0.0:
        return
    x, y = gravity[0] / strength, gravity[1] / strength
    half = 0.2
    axes.set(aspect="equal", xlim=(-0.5, 0.5), ylim=(-0.5, 0.5))
    axes.annotate(
        "",
        xy=(half * x, half * y),
        xytext=(-half * x, -half * y),
        arrowprops={"arrowstyle": "-|>", "color": DARK, "linewidth": 1.3},
    )
    above = "bottom" if y < -0.5 else "top" if y > 0.5 else "center"
    axes.text(-0.3 * x, -0.3 * y, f"gravity\n{strength:.4g} m/s²", ha="center", va=above, fontsize="small", color=DARK)


def _activation(run: BagSeries, name: str, time: float) -> float:
    if run.drive is None or name not in run.drive.names or not len(run.drive.times):
        return 0.0
    return float(np.clip(np.interp(time, run.drive.times, run.drive.column(name)), 0.0, 1.0))


def _unit(angle: float) -> FloatArray:
    return np.array([np.cos(angle), np.sin(angle)])
