"""What the name of a column says: its name without the unit, its unit, and what it holds."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from limb_nodes.signals import units

_BRACKETS = re.compile(r"(?P<name>.*?)\s*(?P<open>[\[({])\s*(?P<unit>[^\[\](){}]*?)\s*[\])}]\s*", re.DOTALL)
_SUFFIX = re.compile(r"(?P<name>.+?)(?:_|\s+/\s*|\s+|,\s*|\.\.)(?P<unit>[^\s_,./]+?)\.?")
# Without brackets only these are units: `RF_m` may be anything.
_SUFFIXES = {*units.VOLTAGE, "deg", "rad", "mm"} - {"V"}
# What stands in round brackets behind a muscle and is no unit.
_SIDES = {
    "left",
    "right",
    "l",
    "r",
    "li",
    "re",
    "lt",
    "rt",
    "links",
    "rechts",
    "raw",
    "filtered",
    "formatted",
    "izq",
    "der",
}
_TIME = re.compile(r"time|zeit|temps\b|tiempo|tempo\b|elapsed|^t$|^secs?$|^seconds?$|^ms$|^msec$")
_KINDS = {
    "a count": r"#|nr\.?|no\.?|n|idx|index|sample|samples|sample ?(index|idx|no\.?|nr|number|count)|frame|frames|"
    r"frame ?(no|number)?|sub ?frame|n ?seq|seq|sequence|counter|count|row|id|package ?(no|number|id)?",
    "digital": r"di|digital.*|marker.*|event.*|trig.*|activity|label.*|status|annotation.*|other|note|notes|comment.*",
    "acceleration": r".*\b(acc|accel|accelerometer|acceleration)\b.*",
    "angular velocity": r".*\b(gyro?|gyroscope)\b.*",
    "magnetic field": r".*\b(mag|magn|magnetometer)\b.*",
    "temperature": r".*\b(temp|temperature)\b.*",
    "the battery": r".*\b(battery|batt)\b.*",
    "force": r".*\b(force|grf|load ?cell)\b.*",
    "torque": r".*\b(torque|moment)\b.*",
    "an angle without a unit": r".*\b(angle|goniometer)\b.*",
}
# Longer cells are remarks and no names.
_LONGEST = 300
_WORDS = {kind: re.compile(words) for kind, words in _KINDS.items()}


@dataclass(frozen=True)
class Column:
    """A column as its header has it.

    name: without the unit; "" if the file names none. unit: "" if it states none; an unknown one as it stands there.
    """

    name: str
    unit: str

    @property
    def says_time(self) -> bool:
        """Whether name or unit say that it holds times."""
        if self.unit not in units.TIME or len(self.name) > _LONGEST:
            return False
        return bool(_TIME.search(self.name.lower().replace("_", " "))) or (self.unit in {"s", "ms", "us", "ns"})

    @property
    def kind(self) -> str:
        """What its name says that it holds, if it states no unit and is no signal of a muscle; else ""."""
        if self.unit or len(self.name) > _LONGEST:
            return ""
        plain = re.sub(r"[_\s]+", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", self.name)).strip().lower()
        return next((kind for kind, words in _WORDS.items() if words.fullmatch(plain)), "")


def column_of(cell: str, unit: str = "") -> Column:
    """The column that a cell of the header names; unit: what a row of units states, which counts before the name."""
    cell = " ".join(cell.split())
    name, named = _split(cell) if len(cell) < _LONGEST else (cell, "")
    if not unit:
        return Column(name, named)
    return Column(name if named else cell, units.unit_named(unit) or unit)


def _split(cell: str) -> tuple[str, str]:
    match = _BRACKETS.fullmatch(cell)
    if match:
        unit, inside = units.unit_named(match["unit"]), match["unit"]
        if unit is not None:
            return match["name"], unit
        if inside.isdigit():
            return cell, ""
        # Square brackets hold units; round ones also words, such as sides and numbers.
        short = 0 < len(inside) <= 3 or re.search(r"[°·^/²³*]", inside)
        if inside.lower() not in _SIDES and (match["open"] == "[" or short) and inside:
            return match["name"], inside
        return cell, ""
    match = _SUFFIX.fullmatch(cell)
    if match:
        unit = units.unit_named(match["unit"])
        of_time = unit in units.TIME and _TIME.search(match["name"].lower())
        if unit is not None and (unit in _SUFFIXES or of_time or "," in cell or "/" in cell):
            return match["name"].rstrip(), unit
    return cell, ""


def numbered(names: Sequence[str]) -> list[str]:
    """The names, all different: one that comes again has a number behind, as in `EMG (2)`."""
    taken, seen = set(names), Counter[str]()
    labels: list[str] = []
    for name in names:
        seen[name] += 1
        label, number = name, seen[name]
        if number > 1:
            while (label := f"{name} ({number})") in taken:
                number += 1
        taken.add(label)
        labels.append(label)
    return labels
