"""A bag gives back what was written, and says in one line what is wrong with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from limb_nodes.bags.read import BagReader
from limb_nodes.bags.types import limb_typestore, make_message
from limb_nodes.bags.write import BagWriter
from limb_nodes.errors import UserError
from limb_nodes.foundation.topics import TOPIC_TYPES

PERIOD_NS = 1_000_000
INFO = {"limb": "name: knee\ngravity: [0.0, -9.81]\n", "seed": 3, "parameters": {"rate": 1000.0}}


def write_run(path: Path, ticks: int = 300, **options: object) -> None:
    """A bag with a torque and a movement in it."""
    with BagWriter(path, INFO, **options) as bag:  # type: ignore[arg-type]
        for k in range(ticks):
            stamp = k * PERIOD_NS
            torque = {
                "torque": [0.5 * k, -k],
                "slope_angle": [1.0, 2.0],
                "slope_velocity": [k, 0],
                "slope_time": [0, 0],
            }
            bag.write(
                "joint_torque",
                stamp,
                make_message(TOPIC_TYPES["joint_torque"], stamp, tick=k, joint=["hip", "knee"], **torque),
            )
            points = [make_message("geometry_msgs/msg/Point", x=float(k), y=2.0 * k, z=0.0) for _ in range(3)]
            bag.write(
                "movement_pattern",
                stamp,
                make_message(TOPIC_TYPES["movement_pattern"], stamp, tick=k, point=["a", "b", "tip"], position=points),
            )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "deep" / "run"
    write_run(path)
    return path


def test_messages_come_back_in_order(run: Path) -> None:
    with BagReader(run) as bag:
        rows = list(bag.read_topic("joint_torque"))
    assert [stamp for stamp, _ in rows] == [k * PERIOD_NS for k in range(300)]
    stamp, message = rows[299]
    assert message.tick == 299
    assert message.joint == ["hip", "knee"]
    np.testing.assert_array_equal(message.torque, [149.5, -299.0])
    assert message.header.stamp.nanosec == stamp


def test_run_info_is_the_first_message(run: Path) -> None:
    with Reader(run) as plain:
        connection, stamp, _ = next(plain.messages())
    assert (connection.topic, stamp) == ("/run_info", 0)
    with BagReader(run) as bag:
        assert bag.run_info() == INFO


def test_text_given_as_run_info_is_kept(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", "seed: 4\n"):
        pass
    with BagReader(tmp_path / "run") as bag:
        assert bag.run_info() == {"seed": 4}


def test_table_holds_every_field(run: Path) -> None:
    with BagReader(run) as bag:
        table = bag.table("joint_torque")
        movement = bag.table("movement_pattern")
    np.testing.assert_allclose(table["time"], np.arange(300) * 1e-3, rtol=0, atol=1e-15)
    assert list(table["joint"]) == ["hip", "knee"]
    np.testing.assert_array_equal(table["tick"], np.arange(300))
    np.testing.assert_array_equal(table["torque"], np.outer(np.arange(300), [0.5, -1.0]))
    np.testing.assert_array_equal(table["slope_angle"], np.tile([1.0, 2.0], (300, 1)))
    assert movement["angle"].shape == (300, 0)
    assert movement["position"].shape == (300, 3, 3)
    np.testing.assert_array_equal(movement["position"][7, 2], [7.0, 14.0, 0.0])


@pytest.mark.parametrize(
    "topic",
    sorted(topic for topic, kind in TOPIC_TYPES.items() if kind.split("/")[0] not in ("diagnostic_msgs", "std_msgs")),
)
def test_table_agrees_with_the_messages(topic: str, tmp_path: Path) -> None:
    """For every topic of a limb that holds numbers, with texts of every alignment."""
    msgtype = TOPIC_TYPES[topic]
    rng = np.random.default_rng(5)
    fields = limb_typestore().fielddefs[msgtype][1]
    with BagWriter(tmp_path / "run", INFO) as bag:
        for k in range(4):
            values: dict[str, object] = {}
            for name, (_, detail) in fields:
                if isinstance(detail[0], tuple) and detail[0][1] == ("float64", 0):
                    values[name] = rng.normal(size=3)
                elif isinstance(detail[0], tuple) and detail[0][1] == ("string", 0):
                    values[name] = ["a", "bc", "déf"]
                elif name == "tick":
                    values[name] = k
            bag.write(topic, k, make_message(msgtype, k, **values))
    with BagReader(tmp_path / "run") as reader:
        table = reader.table(topic)
        for k, (_, message) in enumerate(reader.read_topic(topic)):
            for name, column in table.items():
                if name in ("time", "stamp"):
                    continue
                value = message
                for part in name.split("."):
                    value = getattr(value, part)
                if column.dtype.kind == "U":
                    assert column.tolist() == value
                elif name != "position" or not msgtype.startswith("limb_msgs/"):
                    np.testing.assert_array_equal(column[k], value)


def test_raw_messages_pass_through(run: Path, tmp_path: Path) -> None:
    with BagReader(run) as bag, BagWriter(tmp_path / "copy", bag.run_info(), compressed=False) as copy:
        for stamp, data in bag.read_raw("joint_torque"):
            copy.write_raw("joint_torque", stamp, data, TOPIC_TYPES["joint_torque"])
        assert copy.counts == {"/run_info": 1, "/joint_torque": 300}
        with BagReader(run) as again:
            expected = again.table("joint_torque")
    with BagReader(tmp_path / "copy") as bag:
        result = bag.table("joint_torque")
    for name, column in expected.items():
        np.testing.assert_array_equal(result[name], column)


def test_types_that_are_not_known_are_read_from_the_bag(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("float64[] volt\n", "amplifier_msgs/msg/Sample"))
    with Writer(tmp_path / "emg", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/emg", "amplifier_msgs/msg/Sample", typestore=store)
        sample = store.types["amplifier_msgs/msg/Sample"](volt=np.array([1.0, 2.0]))
        writer.write(connection, 5, store.serialize_cdr(sample, "amplifier_msgs/msg/Sample"))
    with BagReader(tmp_path / "emg") as bag:
        np.testing.assert_array_equal(bag.table("emg")["volt"], [[1.0, 2.0]])


def test_an_existing_folder_is_refused_and_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "keep").write_text("precious")
    with pytest.raises(UserError, match=r"exists already"):
        BagWriter(tmp_path, INFO)
    assert [path.name for path in tmp_path.iterdir()] == ["keep"]


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match="cannot be made"):
        BagWriter(tmp_path / "file" / "run", INFO)


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_an_interrupted_bag_is_readable(error: type[BaseException], tmp_path: Path) -> None:
    with pytest.raises(error), BagWriter(tmp_path / "run", INFO) as bag:
        bag.write("activation", 0, make_message(TOPIC_TYPES["activation"], 0, name=["a"], activation=[0.5]))
        raise error
    with BagReader(tmp_path / "run") as reader:
        assert reader.table("activation")["activation"].tolist() == [[0.5]]


def test_a_namespace_is_part_of_the_name_and_may_be_left_out_when_reading(tmp_path: Path) -> None:
    write_run(tmp_path / "left", 2, namespace="left")
    with BagReader(tmp_path / "left") as bag:
        assert bag.topics == {
            "/left/joint_torque": TOPIC_TYPES["joint_torque"],
            "/left/movement_pattern": TOPIC_TYPES["movement_pattern"],
            "/left/run_info": TOPIC_TYPES["run_info"],
        }
        assert bag.count("joint_torque") == bag.count("/left/joint_torque") == 2
        assert not bag.has("/joint_torque")
        assert bag.run_info() == INFO


def test_latched_topics_are_offered_to_late_subscribers(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", {}, latched={"joint_states"}) as bag:
        bag.expect({"joint_states": TOPIC_TYPES["joint_states"], "activation": TOPIC_TYPES["activation"]})
    with Reader(tmp_path / "run") as reader:
        offered = {
            connection.topic: connection.ext.offered_qos_profiles[0].durability  # type: ignore[union-attr]
            for connection in reader.connections
        }
    assert {topic for topic, durability in offered.items() if durability == QosDurability.TRANSIENT_LOCAL} == {
        "/joint_states",
        "/run_info",
    }


def test_a_name_that_fits_two_topics_is_refused(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "two", INFO) as bag:
        for side in "/left", "/right":
            bag.write(f"{side}/activation", 0, make_message(TOPIC_TYPES["activation"]))
    with (
        BagReader(tmp_path / "two") as reader,
        pytest.raises(UserError, match="is there twice; one of /left/activation, /right/"),
    ):
        reader.table("activation")


def test_a_missing_topic_names_those_that_are_there(run: Path) -> None:
    with BagReader(run) as bag:
        for ask in (bag.read_topic, bag.table, bag.read_raw):
            with pytest.raises(
                UserError, match=r"no topic emg; the bag has /joint_torque, /movement_pattern, /run_info"
            ):
                ask("emg")


def test_messages_of_different_shape_make_no_table(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "run", INFO) as bag:
        for k, name in enumerate((["a"], ["b"])):
            bag.write("activation", k, make_message(TOPIC_TYPES["activation"], k, name=name, activation=[0.0]))
            bag.write("emg_envelope", k, make_message(TOPIC_TYPES["activation"], k, activation=[0.0] * k))
    with BagReader(tmp_path / "run") as reader:
        with pytest.raises(UserError, match="activation: its messages differ in their names"):
            reader.table("activation")
        with pytest.raises(UserError, match="emg_envelope: its messages differ in length"):
            reader.table("emg_envelope")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: None, "no such bag"),
        (lambda path: path.mkdir(), "is no bag"),
        (lambda path: path.write_text("text"), "is no bag"),
        (lambda path: (path.mkdir(), (path / "metadata.yaml").write_text("{}")), "is no bag"),
        (lambda path: (path.mkdir(), (path / "metadata.yaml").write_text("a: [")), "is no bag"),
        (lambda path: (path.mkdir(), (path / "a.mcap").write_text("")), "limb recover"),
    ],
)
def test_what_is_not_a_bag_is_refused_in_one_line(make, said: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    make(tmp_path / "x")
    with pytest.raises(UserError, match=said) as caught:
        BagReader(tmp_path / "x")
    assert str(caught.value).startswith(str(tmp_path / "x"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("where", [0.2, 0.5, 0.8])
def test_damage_in_the_middle_is_told_in_one_line(where: float, tmp_path: Path) -> None:
    path = tmp_path / "run"
    with BagWriter(path, INFO) as bag:
        noise = np.random.default_rng(1).normal(size=(2000, 100))
        for k, row in enumerate(noise):
            bag.write("activation", k, make_message(TOPIC_TYPES["activation"], k, activation=row))
    file = path / "run.mcap"
    data = bytearray(file.read_bytes())
    data[int(where * len(data))] ^= 0xFF
    file.write_bytes(data)
    with BagReader(path) as reader, pytest.raises(UserError, match=r"damaged: .*limb recover") as caught:
        reader.table("activation")
    assert "\n" not in str(caught.value)


def test_a_message_with_a_field_that_the_type_lacks_is_refused() -> None:
    with pytest.raises(TypeError, match="has no field angel"):
        make_message(TOPIC_TYPES["movement_pattern"], angel=[0.0])
