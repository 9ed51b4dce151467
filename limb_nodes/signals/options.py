"""How raw EMG becomes an envelope: the options of every step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np

from limb_nodes.errors import FieldError
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.signals.envelope import DEFAULT_BAND, DEFAULT_LOW_PASS, DEFAULT_ORDER

# An envelope of 6 Hz hardly falls in this time.
DEFAULT_LONGEST_GAP = 0.1
REST = Parameter("rest", "s", "length of the quietest stretch", minimum=0.0)
DELAY = Parameter("delay", "s", "from the EMG to the muscle", minimum=0.0, maximum=1.0)
LONGEST_GAP = Parameter("longest_gap", "s", "longest gap that is bridged", minimum=0.0)


@dataclass(frozen=True)
class EnvelopeOptions:
    """How raw EMG becomes an envelope; None leaves a step out.

    band: lower and upper edge of the band-pass (Hz). rectify: full-wave rectification.
    low_pass: corner of the smoothing (Hz). band_order, low_pass_order: even.
    rest: the quietest stretch of this length (s) is each channel's zero; 0 keeps zero at 0.
    resample: rate of the result (Hz); None keeps the recording's.
    maximum: the envelope that counts as 1, by the channel's name in the recording and in its unit; a
        channel that is not named takes the largest value of its own envelope.
    channels: the channels to take, each with its new name; empty takes every EMG channel as it is.
    angles: the same for the columns in degrees or radians.
    skip: channels to leave out.
    mains: frequency of the mains (Hz), 50 or 60, that a notch removes with its harmonics.
    causal: filter forward only, as live use does.
    delay: time (s) by which the envelope comes later, for the muscle does too.
    trust: channels to normalise even if they seem to hold no signal.
    remove_spikes: put straight lines for lone spikes.
    longest_gap: values that are missing for this long (s) at most are put on straight lines.
    keep_gaps: leave longer gaps as they are (NaN) instead of refusing them.
    """

    band: tuple[float, float] | None = DEFAULT_BAND
    band_order: int = DEFAULT_ORDER
    rectify: bool = True
    low_pass: float | None = DEFAULT_LOW_PASS
    low_pass_order: int = DEFAULT_ORDER
    rest: float = 0.0
    resample: float | None = None
    maximum: Mapping[str, float] = field(default_factory=dict)
    channels: Mapping[str, str] = field(default_factory=dict)
    angles: Mapping[str, str] = field(default_factory=dict)
    skip: Sequence[str] = ()
    mains: float | None = None
    causal: bool = False
    delay: float = 0.0
    trust: Sequence[str] = ()
    remove_spikes: bool = False
    longest_gap: float = DEFAULT_LONGEST_GAP
    keep_gaps: bool = False

    def as_mapping(self) -> dict[str, object]:
        """The options as plain lists, numbers and mappings, for a bag's run_info."""
        plain = asdict(self)
        plain["band"] = None if self.band is None else list(self.band)
        plain["skip"], plain["trust"] = list(self.skip), list(self.trust)
        return plain


def check_numbers(options: EnvelopeOptions, rate: float) -> None:
    """Raise FieldError if a number that no filter checks is out of range. rate: the recording's, Hz."""
    for name, value in options.maximum.items():
        if not (np.isfinite(value) and value > 0):
            raise FieldError("maximum", f"of {name} is {value:g}; a number > 0 is needed")
    for parameter, value in ((REST, options.rest), (DELAY, options.delay), (LONGEST_GAP, options.longest_gap)):
        parameter.check(value)
    if options.resample is not None:
        # Less than twice the low-pass loses some of the envelope; more than ten times the rate adds nothing.
        above, least = (None, 2 * options.low_pass) if options.low_pass else (0.0, None)
        allowed = Parameter("resample", "Hz", "rate of the envelopes", above=above, minimum=least, maximum=10 * rate)
        allowed.check(options.resample)
