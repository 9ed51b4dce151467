"""The units that a text file may name, by quantity: unit -> what one of it is in SI. Empty: the file names none."""

from __future__ import annotations

import math

TIME = {"": 1.0, "s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6}
LENGTH = {"": 1.0, "m": 1.0, "mm": 1e-3}
ANGLE = {"rad": 1.0, **dict.fromkeys(("deg", "degree", "degrees", "°"), math.pi / 180.0)}
# Micro stands twice in Unicode, as a sign of its own and as a Greek letter.
VOLTAGE = {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6, "μV": 1e-6, "nV": 1e-9}
_OTHERS = {"Hz", "N", "Nm", "N m", "g", "m/s", "m/s2", "m/s^2", "deg/s", "rad/s", "%"}
KNOWN = frozenset({*TIME, *LENGTH, *ANGLE, *VOLTAGE, *_OTHERS} - {""})
