"""The units that a text file may name, by quantity: unit -> what one of it is in SI. Empty: the file names none."""

from __future__ import annotations

import math
import re

TIME = {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
LENGTH = {"": 1.0, "m": 1.0, "cm": 1e-2, "mm": 1e-3}
ANGLE = {"rad": 1.0, **dict.fromkeys(("deg", "°"), math.pi / 180.0)}
# Micro stands twice in Unicode, as a sign of its own and as a Greek letter.
VOLTAGE = {"V": 1.0, "mV": 1e-3, "uV": 1e-6, "µV": 1e-6, "μV": 1e-6, "nV": 1e-9}

_OTHERS = {"Hz", "N", "kN", "Nm", "N m", "g", "G", "m/s", "m/s2", "m/s^2", "deg/s", "rad/s", "%", "bpm", "Pa"}
_KNOWN = frozenset({*TIME, *LENGTH, *ANGLE, *VOLTAGE, *_OTHERS} - {""})
_PREFIXES = {"": "", "milli": "m", "micro": "u", "nano": "n", "centi": "c"}
_WORDS = {
    **{f"{prefix}{volt}": f"{sign}V" for prefix, sign in _PREFIXES.items() for volt in ("volt", "volts")},
    **{f"{prefix}{time}": f"{sign}s" for prefix, sign in _PREFIXES.items() for time in ("second", "seconds", "sec")},
    **{f"{prefix}{metre}": f"{sign}m" for prefix, sign in _PREFIXES.items() for metre in ("metre", "meter", "metres")},
    **dict.fromkeys(("secs", "sekunden", "seg"), "s"),
    **dict.fromkeys(("msec", "msecs", "millis"), "ms"),
    **dict.fromkeys(("usec", "µs", "μs", "micros"), "us"),
    **dict.fromkeys(("degree", "degrees", "grad"), "deg"),
    **dict.fromkeys(("radian", "radians"), "rad"),
    **dict.fromkeys(("hertz",), "Hz"),
    **dict.fromkeys(("percent",), "%"),
    "mv": "mV",
    "uv": "uV",
    "minutes": "min",
}


def unit_named(text: str) -> str | None:
    """The unit that a text spells, as this module writes it (`Millivolts` is `mV`); None if it spells no known one."""
    plain = re.sub(r"\s+", " ", text).strip().rstrip(".")
    if plain in _KNOWN:
        return plain
    # MV is the megavolt and no millivolt; a V in small letters is nothing else than the volt.
    return _WORDS.get(plain.lower() if plain[:1] != "M" or len(plain) > 2 else plain) or ("V" if plain == "v" else None)
