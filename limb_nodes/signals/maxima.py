"""Maxima from other recordings, such as maximal voluntary contractions: the envelope that counts as 1."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from shlex import quote

import numpy as np

from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals import units
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording
from limb_nodes.signals.smooth import smooth


def maxima(
    recordings: Sequence[Recording], columns: Mapping[str, str], options: EnvelopeOptions
) -> tuple[dict[str, float], tuple[str, ...]]:
    """The largest envelope of each channel in some recordings, made by the same steps.

    columns: the unit of each channel whose maximum is needed, by its name. Returns the maxima in these units, and
    notes.

    Raises FieldError if no recording has a signal of a channel; UserError if a channel is in a unit that cannot be
    turned into the one that is needed; both as `smooth` does.
    """
    found: dict[str, float] = {}
    places: dict[str, str] = {}
    notes: list[str] = []
    for recording in recordings:
        there = [column for column in columns if column in recording.names]
        factors = [_factor(recording, column, columns[column]) for column in there]
        if not there:
            continue
        given = replace(options, trust=tuple(set(options.trust) & set(there)), keep_gaps=True)
        result = smooth(recording, there, given)
        notes += [f"{recording.source}: {artefact.note}" for artefact in result.artefacts if artefact.note]
        for i, column in enumerate(there):
            if not result.has_signal[i]:
                continue
            peak = int(np.nanargmax(result.values[:, i]))
            value = float(result.values[peak, i]) * factors[i]
            if value > found.get(column, 0.0):
                found[column] = value
                places[column] = f"{column} {value:.4g} {columns[column]}".strip() + (
                    f" ({recording.source} at {peak / recording.rate:.6g} s)"
                )
    for column in columns:
        if column not in found:
            raise FieldError(
                "maximum_from",
                f"is {', '.join(recording.source for recording in recordings)}, without a signal of channel {column}; "
                f"a recording with it is needed, or --maximum {quote(column)}=VALUE",
            )
    return found, (*notes, f"maxima: {', '.join(places.values())}")


def _factor(recording: Recording, column: str, unit: str) -> float:
    """What turns the unit of a channel in a recording into another one."""
    own = recording.unit(column)
    if own == unit:
        return 1.0
    if own in units.VOLTAGE and unit in units.VOLTAGE:
        return units.VOLTAGE[own] / units.VOLTAGE[unit]
    raise UserError(
        f"{recording.source}: channel {column} {f'is in {own}' if own else 'has no unit'}; "
        f"{unit or 'no unit'}, as in the recording to normalise, is needed"
    )
