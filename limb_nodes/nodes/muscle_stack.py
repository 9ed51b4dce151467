"""Node muscle_stack: from activations and joint states to joint torques."""

from __future__ import annotations

from typing import Any

from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from limb_nodes.exchange.forms import BASE
from limb_nodes.exchange.muscles import MusclePart
from limb_nodes.foundation.topics import STATES
from limb_nodes.nodes.base import WARN, LimbNode
from limb_nodes.nodes.markers import COLOURINGS, Markers
from limb_nodes.nodes.messages import stamp_at
from limb_nodes.nodes.qos import LIVE
from limb_nodes.nodes.running import main_of
from limb_nodes.solve.ranges import LEFT, OUT_OF_RANGE


class MuscleStack(LimbNode):
    """Answers the limb's state at tick k with joint_torque k once it holds the activations k and k + 1.

    Publishes `joint_torque`, on request every `state_every` ticks `muscle_state`, `motor_unit_state` and
    `sarcomere_state`, and for whoever looks on `muscle_markers`.
    """

    part: MusclePart

    def __init__(self, **options: Any) -> None:
        super().__init__("muscle_stack", **options)
        every = self.whole("state_every", 1, "publish the states every so many ticks", 1, 1_000_000)
        states = [topic for topic in STATES if self.switch(f"publish_{topic}", True, f"whether to publish {topic}")]
        colouring = self.choice("muscle_colour", COLOURINGS, "what the colours of muscle_markers show")
        self.prefix = self.frame_prefix()
        self.carry(MusclePart(**self.common, states=tuple(states), state_every=every))
        self.markers = Markers(self.limb, colouring)
        self.show(self.draw, self.create_publisher(MarkerArray, "muscle_markers", LIVE))
        self.told = -1
        self.part.tell_ranges = self.tell_ranges

    def draw(self) -> MarkerArray:
        """The muscles at the newest tick that is answered."""
        header = Header(stamp=stamp_at(self.part.tick, self.ticks), frame_id=f"{self.prefix}{BASE}")
        return self.markers.message(header, self.part.angle, self.part.muscles())

    def tell_ranges(self) -> None:
        """Say which lengths of muscles were out of their range, if any; on the log at first and at last."""
        part, told = self.part, self.part.stepper.ranges.told()
        if not told:
            return
        if self.told < 0 or part.tick == part.last_tick:
            self.get_logger().warning("; ".join(f"{length} {words}" for length, words in told.items()))
        self.told = part.tick
        values = {OUT_OF_RANGE + length: words for length, words in told.items()}
        self.diagnose(LEFT, WARN, **values)

    def destroy_node(self) -> None:
        """Tell it at last, if the run ends before its last tick."""
        if 0 <= self.told < self.part.tick:
            self.tell_ranges()
        super().destroy_node()


main = main_of(MuscleStack)

if __name__ == "__main__":
    main()
