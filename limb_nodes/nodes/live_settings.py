"""How a live source is taken: the parameters of activation_input that count without a recording."""

from __future__ import annotations

import math
from dataclasses import dataclass

from limb_nodes.errors import FieldError
from limb_nodes.foundation.parameter import Parameter
from limb_nodes.signals.envelope import DEFAULT_BAND, DEFAULT_LOW_PASS, DEFAULT_ORDER
from limb_nodes.signals.options import EnvelopeOptions

# What is told of a live source on `/diagnostics`.
HEARD, SILENT, NEVER_CAME = "heard", "silent", "never came"
ON_SILENCE = ("zero", "hold", "stop")
SILENCE = Parameter("silence", "s", "without a message", minimum=0.05, maximum=3600.0)
EMG_RATE = Parameter("emg_rate", "Hz", "samples of each channel per second", minimum=0.0, maximum=1e6)


@dataclass(frozen=True)
class LiveSettings:
    """How a live source is taken.

    channels: CHANNEL=MUSCLE,... renames; for raw EMG it names all channels in the order of the values, CHANNEL alone
    for one that is not used. on_silence: hold, zero or stop. silence: a source counts as silent after so long (s).
    emg_rate: of raw EMG (Hz); 0 if the source sends envelopes. maximum: CHANNEL=VALUE,... is the envelope that
    counts as 1, in the unit of the raw EMG. band: LOW,HIGH in Hz, empty for no band-pass. low_pass, mains: Hz, 0 for
    none.
    """

    channels: str = ""
    on_silence: str = ON_SILENCE[0]
    silence: float = 0.5
    emg_rate: float = 0.0
    maximum: str = ""
    mains: float = 0.0
    band: str = f"{DEFAULT_BAND[0]:g},{DEFAULT_BAND[1]:g}"
    band_order: int = DEFAULT_ORDER
    low_pass: float = DEFAULT_LOW_PASS
    low_pass_order: int = DEFAULT_ORDER

    def named(self, field: str) -> dict[str, str]:
        """What `channels` or `maximum` give each channel, empty for a channel alone. Raises FieldError."""
        text = getattr(self, field)
        result: dict[str, str] = {}
        for entry in text.split(",") if text else ():
            name, equals, value = (part.strip() for part in entry.partition("="))
            if not name or (equals and not value):
                form = "CHANNEL=MUSCLE" if field == "channels" else "CHANNEL=VALUE"
                raise FieldError(field, f"is {text}; {form}, with commas between several, is needed")
            if name in result:
                raise FieldError(field, f"names {name} twice; different channels are needed")
            result[name] = value
        return result

    def maxima(self) -> dict[str, float]:
        """The envelope that counts as 1, by channel. Raises FieldError."""
        result = {}
        for name, text in self.named("maximum").items():
            result[name] = number(text)
            if not 0.0 < result[name] < math.inf:
                raise FieldError("maximum", f"of {name} is {text or 'missing'}; a number > 0 is needed")
        return result

    def steps(self) -> EnvelopeOptions:
        """The filters of raw EMG. Raises FieldError if the band is not two numbers."""
        edges = [number(text) for text in self.band.split(",")] if self.band else []
        if edges and (len(edges) != 2 or not all(map(math.isfinite, edges))):
            raise FieldError("band", f"is {self.band}; LOW,HIGH in Hz is needed")
        return EnvelopeOptions(
            band=(edges[0], edges[1]) if edges else None,
            band_order=self.band_order,
            low_pass=self.low_pass or None,
            low_pass_order=self.low_pass_order,
            mains=self.mains or None,
        )


def number(text: str) -> float:
    """The number that a text says, NaN if it says none."""
    try:
        return float(text)
    except ValueError:
        return math.nan
