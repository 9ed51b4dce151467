"""Which columns of a recording are EMG and which are angles, and under which names they go on."""

from __future__ import annotations

from limb_nodes.errors import FieldError, UserError
from limb_nodes.signals import units
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording


def check_names(recording: Recording, options: EnvelopeOptions) -> None:
    """Raise FieldError if an option names a column that the recording has not, or one of another kind."""
    fields = {
        "channels": options.channels,
        "angles": options.angles,
        "skip": options.skip,
        "maximum": options.maximum,
        "trust": options.trust,
    }
    for option, names in fields.items():
        for name in names:
            if name not in recording.names:
                raise FieldError(
                    option, f"names {name!r}; one of {', '.join(recording.names)} is needed", recording.source
                )
    for name in options.channels:
        unit = recording.unit(name)
        if unit in units.ANGLE:
            raise FieldError(
                "channels",
                f"names {name!r}, which is in {unit}; a column in V, mV, uV or without a unit is needed",
                recording.source,
            )
    for name in options.angles:
        unit = recording.unit(name)
        if unit not in units.ANGLE:
            stated = f"is in {unit}" if unit else "has no unit"
            raise FieldError(
                "angles", f"names {name!r}, which {stated}; a column in deg or rad is needed", recording.source
            )


def _is_emg(recording: Recording, column: str) -> bool:
    return recording.unit(column) == "" or recording.unit(column) in units.VOLTAGE


def chosen(recording: Recording, options: EnvelopeOptions) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Pick the EMG and the angle columns, each as (column, new name)."""
    left = [name for name in recording.names if name not in options.skip]
    emg = [name for name in left if name in options.channels or (not options.channels and _is_emg(recording, name))]
    angle = [
        name for name in left if recording.unit(name) in units.ANGLE and (name in options.angles or not options.angles)
    ]
    if not emg:
        raise UserError(
            f"{recording.source}: no EMG channel is left of {', '.join(recording.names)}; at least one is needed"
        )
    for name in options.maximum:
        if name not in emg:
            raise FieldError("maximum", f"names {name!r}; one of {', '.join(emg)} is needed", recording.source)
    channels = [(name, options.channels.get(name, name)) for name in emg]
    angles = [(name, options.angles.get(name, name)) for name in angle]
    for option, columns in (("channels", channels), ("angles", angles)):
        new = [name for _, name in columns]
        for name in new:
            if new.count(name) > 1:
                raise FieldError(option, f"names two columns {name!r}; different names are needed", recording.source)
    return channels, angles


def left_out(recording: Recording, options: EnvelopeOptions) -> tuple[str, ...]:
    """Say which columns were left out for their unit."""
    return tuple(
        f"column '{name}' is in {recording.unit(name)}, neither EMG nor angle: left out"
        for name in recording.names
        if recording.unit(name) not in units.ANGLE
        and not _is_emg(recording, name)
        and name not in options.channels
        and name not in options.skip
    )
