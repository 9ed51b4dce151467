"""OpenSim: the arm with Millard's muscles on elastic tendons, at its default accuracy.

Each muscle runs straight from its origin over one point beside the joint to its insertion;
OpenSim's own arm26 wraps around surfaces, which costs more. Run as a module, it works in a process
of its own, for OpenSim brings its own libraries.
"""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from limb_nodes.model import Limb

NAME = "OpenSim, Millard elastic"
SPECIFIC_LENGTH = 2.7e-6


def muscle_description(limb: Limb) -> list[dict[str, float]]:
    """Numbers of the muscles as OpenSim wants them."""
    found = []
    for muscle in limb.muscles:
        path, tendon = muscle.laws["path"].values, muscle.laws["tendon"].values
        series = sum(unit.values["series_sarcomeres"] for unit in muscle.units) / len(muscle.units)
        found.append(
            {
                "joint": muscle.joints[0],
                "role": muscle.role,
                "force": sum(unit.values["parallel_sarcomeres"] for unit in muscle.units) * 9.7778e-13,
                "optimal": series * SPECIFIC_LENGTH,
                "slack": tendon["slack_length"],
                "arm": path["moment_arm"],
                "proximal": path["proximal_distance"],
                "distal": path["distal_distance"],
            }
        )
    return found


def description(limb: Limb, duration: float) -> dict[str, Any]:
    """What the process that measures is told."""
    return {
        "segments": [
            [s.mass, s.com_distance, s.inertia, s.length, s.angle, list(s.joint_range or (-3.0, 3.0))]
            for s in limb.segments
        ],
        "muscles": muscle_description(limb),
        "duration": duration,
    }


def build(given: dict[str, Any]) -> Any:
    """The model."""
    import opensim as osim

    model = osim.Model()
    model.setGravity(osim.Vec3(0.0, -9.81, 0.0))
    bodies = [model.getGround()]
    for index, (mass, com, inertia, _, angle, span) in enumerate(given["segments"]):
        place = given["segments"][index - 1][3] if index else 0.0
        body = osim.Body(
            f"segment{index}", mass, osim.Vec3(0.0, -com, 0.0), osim.Inertia(inertia, 0.1 * inertia, inertia, 0, 0, 0)
        )
        model.addBody(body)
        zero = osim.Vec3(0.0)
        joint = osim.PinJoint(f"joint{index}", bodies[-1], osim.Vec3(0.0, -place, 0.0), zero, body, zero, zero)
        coordinate = joint.updCoordinate()
        coordinate.setName(f"angle{index}")
        coordinate.setDefaultValue(angle)
        model.addJoint(joint)
        limit = osim.CoordinateLimitForce(f"angle{index}", _degrees(span[1]), 20.0, _degrees(span[0]), 20.0, 1.0, 5.0)
        model.addForce(limit)
        bodies.append(body)
    controller = osim.PrescribedController()
    controller.setName("input")
    model.addController(controller)
    for index, m in enumerate(given["muscles"]):
        j = int(m["joint"])
        muscle = osim.Millard2012EquilibriumMuscle(f"muscle{index}", m["force"], m["optimal"], m["slack"], 0.0)
        side = m["role"] * m["arm"]
        above = -given["segments"][j - 1][3] if j else 0.0
        muscle.addNewPathPoint("origin", bodies[j], osim.Vec3(side, above + m["proximal"], 0.0))
        muscle.addNewPathPoint("joint", bodies[j], osim.Vec3(side, above, 0.0))
        muscle.addNewPathPoint("insertion", bodies[j + 1], osim.Vec3(side, -m["distal"], 0.0))
        model.addForce(muscle)
        controller.addActuator(muscle)
        shift = 0.0 if m["role"] > 0 else 1.5707963267948966
        wave = osim.Sine(1.0, 6.283185307179586, shift, 0.0)
        controller.prescribeControlForActuator(f"muscle{index}", wave)
    model.finalizeConnections()
    return model


def _degrees(angle: float) -> float:
    return angle * 57.29577951308232


def measure(given: dict[str, Any], accuracy: float | None) -> dict[str, Any]:
    """Wall and processor time of one solve, and the angles at its end."""
    import opensim as osim

    osim.Logger.setLevelString("error")
    model = build(given)
    state = model.initSystem()
    model.equilibrateMuscles(state)
    manager = osim.Manager(model)
    if accuracy is not None:
        manager.setIntegratorAccuracy(accuracy)
    manager.initialize(state)
    wall, cpu = time.perf_counter(), time.process_time()
    final = manager.integrate(given["duration"])
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    angles = [model.getCoordinateSet().get(k).getValue(final) for k in range(len(given["segments"]))]
    return {"wall": wall, "cpu": cpu, "angles": angles}


if __name__ == "__main__":
    request = json.load(sys.stdin)
    print(json.dumps(measure(request["arm"], request["accuracy"])))
