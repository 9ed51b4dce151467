"""MuJoCo: the same segments, joints, ranges and number of muscles, Euler's method at 1 ms.

Its muscles are its own: no sarcomeres, no motor units, no elastic tendon.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.model import Limb

STEP = 1e-3
NAME = "MuJoCo Euler 1 ms"


def model_text(limb: Limb) -> str:
    """The limb in MuJoCo's language, in the plane x, z."""
    inner = ""
    for index in reversed(range(len(limb.segments))):
        segment = limb.segments[index]
        place = limb.segments[index - 1].length if index else 0.0
        span = segment.joint_range
        limits = f'limited="true" range="{span[0]} {span[1]}"' if span else 'limited="false"'
        inertia = segment.inertia
        inner = (
            f'<body pos="0 0 {-place}"><joint name="joint{index}" type="hinge" axis="0 -1 0" {limits}/>'
            f'<inertial pos="0 0 {-segment.com_distance}" mass="{segment.mass}" '
            f'diaginertia="{inertia} {inertia} {0.1 * inertia}"/>{inner}</body>'
        )
    muscles = ""
    for muscle in limb.muscles:
        arm = muscle.role * muscle.laws["path"].values["moment_arm"]
        force = sum(unit.values["parallel_sarcomeres"] for unit in muscle.units) * 1e-12
        reach = abs(arm) * np.pi
        muscles += (
            f'<muscle joint="joint{muscle.joints[0]}" gear="{-arm}" force="{force}" lengthrange="{-reach} {reach}"/>'
        )
    return (
        f'<mujoco><compiler angle="radian" autolimits="false"/><option timestep="{STEP}" integrator="Euler" '
        f'gravity="{limb.gravity[0]} 0 {limb.gravity[1]}"><flag contact="disable"/></option>'
        f"<worldbody>{inner}</worldbody><actuator>{muscles}</actuator></mujoco>"
    )


class MujocoLimb:
    """A limb under an excitation [T, muscles], sampled at 1 kHz."""

    def __init__(self, limb: Limb, excitation: FloatArray) -> None:
        import mujoco
        from mujoco import rollout

        self.mujoco, self.rollout = mujoco, rollout
        self.limb = limb
        self.model = mujoco.MjModel.from_xml_string(model_text(limb))
        self.data = mujoco.MjData(self.model)
        self.control = np.ascontiguousarray(excitation[:-1])
        self.start = self.state([segment.angle for segment in limb.segments])

    def state(self, angles: list[float]) -> FloatArray:
        """A full state with given joint angles, at rest otherwise."""
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = angles
        size = self.mujoco.mj_stateSize(self.model, self.mujoco.mjtState.mjSTATE_FULLPHYSICS)
        found = np.empty(size)
        self.mujoco.mj_getState(self.model, self.data, found, self.mujoco.mjtState.mjSTATE_FULLPHYSICS)
        return found

    def solve(self) -> FloatArray:
        """Angles after every step [T - 1, n]."""
        states, _ = self.rollout.rollout(self.model, self.data, self.start[np.newaxis], self.control[np.newaxis])
        return np.asarray(states[0, :, 1 : 1 + self.model.nq])

    def error(self) -> float:
        """Largest distance (rad) of the angles from those of its own Runge-Kutta method at 0.1 ms."""
        coarse = self.solve()
        fine = self.mujoco.MjModel.from_xml_string(
            model_text(self.limb).replace('integrator="Euler"', 'integrator="RK4"')
        )
        fine.opt.timestep = STEP / 10
        control = np.repeat(self.control, 10, axis=0)
        states, _ = self.rollout.rollout(fine, self.mujoco.MjData(fine), self.start[np.newaxis], control[np.newaxis])
        return float(np.abs(states[0, 9::10, 1 : 1 + fine.nq] - coarse).max())

    def ensemble(self, angles: FloatArray, threads: int) -> Any:
        """Samples [N] of the first joint's angle in threads; at most 100 at once are kept."""
        others = [segment.angle for segment in self.limb.segments[1:]]
        starts = np.stack([self.state([angle, *others]) for angle in angles])
        data = [self.mujoco.MjData(self.model) for _ in range(threads)]
        last = []
        with self.rollout.Rollout(nthread=threads) as pool:
            for first in range(0, len(starts), 100):
                batch = starts[first : first + 100]
                control = np.broadcast_to(self.control, (len(batch), *self.control.shape))
                states, _ = pool.rollout(self.model, data, batch, np.ascontiguousarray(control))
                last.append(states[:, -1, 1])
        return np.concatenate(last)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))
