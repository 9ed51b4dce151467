"""Read a raw recording from a bag."""

from __future__ import annotations

from pathlib import Path

from limb_nodes.signals.bag_field import BagOptions
from limb_nodes.signals.clock import fit_clock
from limb_nodes.signals.named_values import read_named_values
from limb_nodes.signals.recording import Recording, without_empty_end

# Raw EMG that `limb emg` has kept, and that a live source sends.
RAW_TOPICS = ("emg_raw", "emg")


def read_bag_recording(path: str | Path, rate: float | None = None, options: BagOptions | None = None) -> Recording:
    """Read a recording from the topics `emg_raw` or `emg` of a bag, or the field that the options name.

    rate: samples per second (Hz), whatever the times say; None takes what they say.

    Raises UserError if the bag cannot be read, or its times have no even clock; FieldError if an option is at fault or
    could decide.
    """
    series = read_named_values(path, RAW_TOPICS, options, rate)
    values, empty = without_empty_end(f"{path}: topic {series.topic}", series.values)
    fitted = fit_clock(str(path), series.times[: len(values)], series.place, rate)
    units = ("",) * len(series.names)
    notes = series.notes + empty + fitted.notes
    start = series.start * 1e-9 + fitted.start
    return Recording(str(path), series.names, units, fitted.even(values), fitted.rate, notes, start)
