"""Bags of envelopes, with the raw EMG beside them: write them, and read the raw EMG back."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from limb_nodes.bags.bulk import write_table
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import make_message
from limb_nodes.bags.versions import versions
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.arrays import FloatArray
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.signals.emg import Envelopes
from limb_nodes.signals.options import EnvelopeOptions

ENVELOPE_TOPIC = "emg_envelope"
ANGLE_TOPIC = "reference_angle"
RAW_TOPIC = "emg_raw"


def write_envelopes(
    result: Envelopes, out: str | Path, options: EnvelopeOptions | None = None, *, raw: bool = True
) -> None:
    """Write envelopes to a new bag: `emg_envelope` and, if there are angles, `reference_angle` at every tick.

    Tick k is stamped k times the period, rounded to whole nanoseconds. raw: write the raw EMG as well, in single
    precision: `emg_raw`, a message [samples, channels] for each second, stamped with the time of its first sample.
    run_info holds the recording's name, the options, what became of each channel, and versions.

    Raises UserError if the bag cannot be made; nothing is written then.
    """
    period = round(1e9 / result.rate)
    run_info = {
        "command": "limb emg",
        "source": result.source,
        "rate": result.rate,
        "period_ns": period,
        "raw_rate": result.raw_rate,
        "parameters": (options or EnvelopeOptions()).as_mapping(),
        "maximum_from": list(result.maximum_from),
        "channels": [asdict(channel) for channel in result.channels],
        "angles": [asdict(channel) for channel in result.angle_channels],
        "artefacts": [asdict(artefact) for artefact in result.artefacts],
        "notes": list(result.notes),
        "versions": versions(),
    }
    stamps = np.arange(len(result.values), dtype=np.int64) * period
    with BagWriter(out, run_info) as bag:
        if raw:
            _write_raw(bag, result)
        write_table(
            bag,
            ENVELOPE_TOPIC,
            TOPIC_TYPES[ENVELOPE_TOPIC],
            stamps,
            {"name": result.names},
            {"envelope": result.values},
        )
        if result.angle_channels:
            names = [channel.name for channel in result.angle_channels]
            write_table(
                bag, ANGLE_TOPIC, TOPIC_TYPES[ANGLE_TOPIC], stamps, {"name": names}, {"position": result.angles}
            )


def _write_raw(bag: BagWriter, result: Envelopes) -> None:
    samples, channels = result.raw.shape
    size = max(1, round(result.raw_rate))
    for start in range(0, samples, size):
        block = result.raw[start : start + size]
        dimensions = [
            make_message("std_msgs/msg/MultiArrayDimension", label=label, size=extent, stride=stride)
            for label, extent, stride in (("sample", len(block), block.size), ("channel", channels, channels))
        ]
        layout = make_message("std_msgs/msg/MultiArrayLayout", dim=dimensions)
        message = make_message(TOPIC_TYPES[RAW_TOPIC], layout=layout, data=block.ravel())
        bag.write(RAW_TOPIC, round(1e9 * start / result.raw_rate), message)


def read_raw(reader: BagReader, topic: str, rate: float, channels: int) -> tuple[FloatArray, FloatArray]:
    """Times [samples] in s and raw EMG [samples, channels] of a bag that `write_envelopes` wrote.

    rate, channels: as its run_info says. Raises UserError if the topic is not as written.
    """
    times, blocks = [np.empty(0)], [np.empty((0, channels))]
    for stamp, message in reader.read_topic(topic):
        if len(message.data) % channels:
            raise UserError(
                f"{reader.path}: topic {topic} has {len(message.data)} values; as many of each of {channels} channels "
                "are needed"
            )
        blocks.append(np.asarray(message.data, dtype=np.float64).reshape(-1, channels))
        times.append(stamp * 1e-9 + np.arange(len(blocks[-1])) / rate)
    return np.concatenate(times), np.concatenate(blocks)
