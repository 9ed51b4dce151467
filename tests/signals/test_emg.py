"""From a recording to envelopes in a bag: the choice of channels, the options, the command."""

from dataclasses import replace

import numpy as np
import pytest

from limb_nodes import cli
from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES
from limb_nodes.signals.emg import envelopes
from limb_nodes.signals.envelope_bag import write_envelopes
from limb_nodes.signals.options import EnvelopeOptions
from limb_nodes.signals.recording import Recording

SAMPLES = 2000


def recording(**changes) -> Recording:
    rng = np.random.default_rng(4)
    values = np.column_stack(
        [rng.normal(size=SAMPLES), 3 * rng.normal(size=SAMPLES), np.linspace(0, 90, SAMPLES), np.ones(SAMPLES)]
    )
    given = {
        "source": "made.txt",
        "names": ("RF", "VM", "FX", "force"),
        "units": ("mV", "uV", "deg", "N"),
        "values": values,
        "rate": 1000.0,
    }
    return Recording(**{**given, **changes})


def limb_emg(*arguments) -> int:
    return cli.main(["emg", *map(str, arguments)])


def refusal(capsys, *arguments) -> str:
    assert limb_emg(*arguments) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


def test_each_channel_reaches_its_own_maximum_once():
    result = envelopes(recording())
    assert result.names == ("RF", "VM")
    assert result.values.shape == (SAMPLES, 2)
    np.testing.assert_array_equal(result.values.max(axis=0), [1, 1])
    assert result.values.min() >= 0
    # Noise of three times the amplitude has three times the envelope.
    assert result.channels[1].maximum / result.channels[0].maximum == pytest.approx(3, rel=0.2)
    assert [channel.clipped for channel in result.channels] == [0, 0]


def test_columns_that_are_no_emg_are_kept_as_angles_or_left_out_with_a_note():
    result = envelopes(recording())
    assert [channel.name for channel in result.angle_channels] == ["FX"]
    np.testing.assert_allclose(result.angles[[0, -1], 0], [0, np.pi / 2])
    assert result.notes == ("column 'force' is in N, neither EMG nor angle: left out",)


def test_given_maximum_scales_and_clips():
    own = envelopes(recording())
    level = own.channels[0].maximum
    twice = envelopes(recording(), EnvelopeOptions(maximum={"RF": 2 * level}))
    np.testing.assert_allclose(twice.values[:, 0], own.values[:, 0] / 2)
    half = envelopes(recording(), EnvelopeOptions(maximum={"RF": level / 2}))
    np.testing.assert_allclose(half.values[:, 0], np.minimum(1, 2 * own.values[:, 0]))
    assert half.channels[0].clipped == (own.values[:, 0] > 0.5).sum() > 0


def test_channels_are_selected_and_renamed():
    options = EnvelopeOptions(channels={"VM": "vastus"}, angles={"FX": "knee"}, skip=("force",))
    result = envelopes(recording(), options)
    assert result.names == ("vastus",)
    assert result.angle_channels[0].name == "knee"
    np.testing.assert_array_equal(result.values[:, 0], envelopes(recording()).values[:, 1])
    assert envelopes(recording(), EnvelopeOptions(skip=("RF", "FX"))).names == ("VM",)


def test_rest_level_becomes_zero_and_maximum_stays_one():
    quiet = recording()
    quiet.values[800:1400, 0] *= 0.1
    plain = envelopes(quiet).values[:, 0]
    result = envelopes(quiet, EnvelopeOptions(rest=0.3))
    rest = plain[900:1300].mean()
    assert result.channels[0].rest / result.channels[0].maximum == pytest.approx(rest, rel=0.2)
    assert result.values[900:1300, 0].mean() < 0.02 < rest
    assert result.values[:, 0].max() == 1.0


def test_steps_can_be_left_out():
    options = EnvelopeOptions(band=None, rectify=False, low_pass=None, maximum={"RF": 2.0})
    raw = recording()
    result = envelopes(raw, options)
    np.testing.assert_allclose(result.values[:, 0], np.clip(raw.values[:, 0] / 2, 0, 1))


def test_resampled_envelope_keeps_time_and_angle():
    plain, slow = envelopes(recording()), envelopes(recording(), EnvelopeOptions(resample=200.0))
    assert slow.rate == 200.0
    np.testing.assert_allclose(slow.values, plain.values[::5], atol=1e-12)
    np.testing.assert_allclose(slow.angles, plain.angles[::5], atol=1e-12)


def test_gaps_are_counted_per_channel_and_hardly_matter():
    raw = recording()
    raw.values[500:503, 0] = np.nan
    raw.values[700, 0] = np.nan
    raw.values[:2, 2] = np.nan
    result = envelopes(raw)
    gaps = result.channels[0].gaps
    assert (gaps.count, gaps.samples, gaps.longest) == (2, 4, 3)
    assert result.channels[1].gaps.count == 0
    assert result.angle_channels[0].gaps.samples == 2
    assert np.isfinite(result.values).all()
    assert np.abs(result.values - envelopes(recording()).values).max() < 0.1


@pytest.mark.parametrize(
    ("changes", "options", "words"),
    [
        ({}, {"channels": {"XX": "a"}}, "made.txt: channels names 'XX'; one of RF, VM, FX, force is needed"),
        ({}, {"skip": ("XX",)}, "skip names 'XX'; one of"),
        ({}, {"maximum": {"XX": 1.0}}, "maximum names 'XX'; one of"),
        ({}, {"angles": {"XX": "a"}}, "angles names 'XX'; one of"),
        ({}, {"channels": {"FX": "a"}}, "channels names 'FX', which is in deg; a column in V, mV, uV"),
        ({}, {"angles": {"RF": "a"}}, "angles names 'RF', which is in mV; a column in deg or rad is needed"),
        ({}, {"channels": {"RF": "a", "VM": "a"}}, "channels names two columns 'a'; different names are needed"),
        ({}, {"channels": {"RF": "a"}, "maximum": {"VM": 1.0}}, "maximum names 'VM'; one of RF is needed"),
        ({}, {"skip": ("RF", "VM")}, "no EMG channel is left"),
        ({}, {"maximum": {"RF": 0.0}}, "maximum of RF is 0; a number > 0 is needed"),
        ({}, {"maximum": {"RF": float("nan")}}, "maximum of RF is nan; a number > 0 is needed"),
        ({}, {"rest": -1.0}, "rest is -1; a number >= 0 in s is needed"),
        ({}, {"rest": 60.0}, "rest is 60; a number <= 2 in s, the whole recording"),
        ({}, {"rest": 0.5, "maximum": {"RF": 1e-9}}, "the maximum of channel RF is 1e-09; a number >"),
        ({}, {"resample": 0.0}, "resample is 0; a number >= 12"),
        ({}, {"resample": 1e15}, "a number >= 12 and <= 10000 in Hz is needed"),
        ({}, {"resample": 10.0}, "resample is 10; a number >= 12 and"),
        ({"rate": 500.0}, {}, "made.txt (500 Hz): band corner is 450; a number > 0 and < 250 in Hz"),
        ({}, {"band": (float("nan"), 450.0)}, "band edges are nan and 450; a lower"),
        ({}, {"low_pass": 0.0}, "low_pass corner is 0; a number > 0"),
        ({}, {"band_order": 5}, "band order is 5; an even number from 2 to 12"),
        (
            {"values": recording().values[:30]},
            {},
            "band corner is 20; 50 samples, one period of it,",
        ),
        ({"values": np.full((500, 4), np.nan)}, {}, "channel RF holds no value; a channel with a signal is needed"),
        ({"values": np.ones((500, 4))}, {}, "channel RF is 1 everywhere"),
    ],
)
def test_bad_options_are_named(changes, options, words):
    with pytest.raises(UserError) as error:
        envelopes(recording(**changes), EnvelopeOptions(**options))
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.fixture
def raw_file(tmp_path):
    raw = recording()
    path = tmp_path / "raw.csv"
    rows = [",".join(f"{value:.6g}" for value in row) for row in raw.values]
    rows[10] = "," + rows[10].split(",", 1)[1]
    path.write_text("RF [mV],VM [uV],FX [deg],force [N]\n" + "\n".join(rows) + "\n,,,\n")
    return path


def test_command_writes_every_sample_and_says_what_it_did(raw_file, tmp_path, capsys):
    out = tmp_path / "env"
    assert limb_emg(raw_file, "-o", out, "--rate", 1000, "--channel", "RF=flexor", "--angle", "FX=knee") == 0
    printed = capsys.readouterr().out
    assert "1 (1 samples)" in printed
    assert "left out: 1" in printed
    assert str(out) in printed
    with BagReader(out) as bag:
        table = bag.table("emg_envelope")
        angle = bag.table("reference_angle")
        info = bag.run_info()
    assert table["name"].tolist() == ["flexor"]
    np.testing.assert_array_equal(table["stamp"], np.arange(SAMPLES) * 1_000_000)
    assert table["envelope"].max() == 1.0
    assert angle["name"].tolist() == ["knee"]
    np.testing.assert_allclose(angle["position"][:, 0], np.linspace(0, np.pi / 2, SAMPLES), atol=1e-6)
    assert info["source"] == str(raw_file)
    assert info["parameters"]["band"] == [20.0, 450.0]
    assert info["channels"][0]["gaps"] == {"count": 1, "samples": 1, "longest": 1}


def test_every_message_is_as_if_written_by_itself(tmp_path):
    raw = recording(rate=900.0)
    raw.values[:, 3] *= np.linspace(-30, 30, SAMPLES)
    raw = replace(raw, units=("mV", "uV", "deg", "rad"))
    result = envelopes(raw, EnvelopeOptions(band=(20.0, 400.0)))
    write_envelopes(result, tmp_path / "env")
    with BagReader(tmp_path / "env") as bag:
        rows = {topic: list(bag.read_topic(topic)) for topic in ("emg_envelope", "reference_angle")}
    for topic, fields, values in (
        ("emg_envelope", {"name": ["RF", "VM"]}, {"envelope": result.values}),
        ("reference_angle", {"name": ["FX", "force"]}, {"position": result.angles}),
    ):
        assert len(rows[topic]) == SAMPLES
        for tick, (stamp, message) in enumerate(rows[topic]):
            own = {name: np.ascontiguousarray(column[tick]) for name, column in values.items()}
            assert stamp == round(1e9 / 900) * tick
            expected = make_message(TOPIC_TYPES[topic], stamp, **fields, **own)
            store = limb_typestore()
            assert store.serialize_cdr(message, TOPIC_TYPES[topic]) == store.serialize_cdr(expected, TOPIC_TYPES[topic])


def test_bag_of_raw_emg_gives_the_same_envelopes(raw_file, tmp_path):
    limb_emg(raw_file, "-o", tmp_path / "a", "--rate", 1000, "--skip", "FX")
    raw = recording().values[:, :2]
    raw[10, 0] = np.nan
    with BagWriter(tmp_path / "raw", {}) as bag:
        for tick, row in enumerate(np.array([[float(f"{v:.6g}") for v in row] for row in raw])):
            stamp = 5_000_000_000 + tick * 1_000_000
            message = make_message(
                "limb_msgs/msg/MuscleActivation", stamp, tick=tick, name=["RF", "VM"], activation=row
            )
            bag.write("emg_raw", stamp, message)
    limb_emg(tmp_path / "raw", "-o", tmp_path / "b")
    with BagReader(tmp_path / "a") as a, BagReader(tmp_path / "b") as b:
        np.testing.assert_array_equal(a.table("emg_envelope")["envelope"], b.table("emg_envelope")["envelope"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rate", "1000", "--maximum", "RF"], "--maximum is RF; COLUMN=VALUE is needed"),
        (["--rate", "1000", "--maximum", "RF=high"], "--maximum of RF is 'high'; a number > 0 is needed"),
        (["--rate", "1000", "--channel", "RF", "--channel", "RF=a"], "--channel names 'RF' twice"),
        (["--rate", "1000", "--channel", "RF="], "--channel is RF=; COLUMN[=NAME] is needed"),
        (["--rate", "100"], "(100 Hz): --band-pass corner is 450; a number > 0 and < 50 in Hz"),
        ([], "--rate is missing: there are no times, and the header states no samples per second; a number > 0"),
    ],
)
def test_nothing_is_written_if_something_is_wrong(raw_file, tmp_path, capsys, arguments, words):
    assert words in refusal(capsys, raw_file, "-o", tmp_path / "env", *arguments)
    assert not (tmp_path / "env").exists()


def test_existing_output_is_refused_and_kept(raw_file, tmp_path, capsys):
    (tmp_path / "env").mkdir()
    (tmp_path / "env" / "mine.txt").write_text("kept")
    assert "exists already" in refusal(capsys, raw_file, "-o", tmp_path / "env", "--rate", 1000)
    assert (tmp_path / "env" / "mine.txt").read_text() == "kept"


def test_bag_without_the_topic_says_what_there_is(raw_file, tmp_path, capsys):
    limb_emg(raw_file, "-o", tmp_path / "env", "--rate", 1000, "--no-raw")
    line = refusal(capsys, tmp_path / "env", "-o", tmp_path / "again")
    assert (
        "no message on emg_raw or emg; one of /emg_envelope (field envelope), /reference_angle (field position) is"
        in line
    )
