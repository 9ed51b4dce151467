"""A topic of a run is taken tick by tick, each once and in order, whatever comes."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from limb_nodes.bags.types import limb_typestore
from limb_nodes.exchange.forms import Form, forms_of
from limb_nodes.exchange.outgoing import Outgoing
from limb_nodes.exchange.stream import HISTORY, Conflict, Stream
from limb_nodes.exchange.ticks import Ticks
from limb_nodes.model import load_limb
from tests.faults.forged import at_tick, numbered, stamped, valued

LIMB = Path(__file__).resolve().parents[2] / "params" / "arm.yaml"
PERIOD = Ticks(500.0).nanoseconds
TICKS = st.integers(0, 12)


@cache
def forms() -> dict[str, Form]:
    return forms_of(load_limb(LIMB), 500.0)


def message(tick: int, value: float = 0.25, topic: str = "joint_torque") -> bytes:
    """A message of a tick whose numbers are all the same."""
    form = forms()[topic]
    sent: list[bytes] = []
    outgoing = Outgoing(form, PERIOD)
    outgoing.send = sent.append
    for name, values in outgoing.values.items():
        values[...] = -1 if name == "last_tick" else value
    outgoing.publish(tick)
    return sent[0]


def stream(gaps: bool = False) -> Stream:
    return Stream(forms()["joint_torque"], PERIOD, gaps)


def take_all(taker: Stream, ticks: list[int]) -> list[int]:
    """What is taken of messages of these ticks."""
    taken = []
    for tick in ticks:
        with suppress(ValueError):
            taken += [one for one, _ in taker.take(message(tick))]
    return taken


@given(st.lists(TICKS))
def test_without_gaps_each_tick_is_taken_in_its_turn(ticks):
    expected: list[int] = []
    for tick in ticks:
        if tick == len(expected):
            expected.append(tick)
    assert take_all(stream(), ticks) == expected


@given(st.lists(TICKS))
def test_with_gaps_two_that_follow_one_another_pass_over_what_is_missing(ticks):
    taken = take_all(stream(gaps=True), ticks)
    assert taken == sorted(set(taken))
    for before, behind in zip([-1, *taken], taken, strict=False):
        # Whoever passes over a tick brings the next one with him.
        assert behind == before + 1 or behind + 1 in taken
    assert set(taken) <= set(ticks)


@given(st.permutations(range(6)))
def test_what_comes_in_order_is_taken_whatever_came_before(ticks):
    taker = stream()
    before = take_all(taker, list(ticks))
    assert before + take_all(taker, list(range(6))) == list(range(6))


def test_after_a_gap_the_newest_are_taken():
    assert take_all(stream(gaps=True), [0, 1, 7, 8, 9]) == [0, 1, 7, 8, 9]
    assert take_all(stream(gaps=True), [0, 1, 7, 2, 3]) == [0, 1, 2, 3]


def test_a_copy_is_nothing_and_another_value_is_a_conflict():
    taker = stream()
    take_all(taker, [0, 1, 2])
    assert taker.take(message(1)) == ()
    with pytest.raises(Conflict, match="tick 1 has come twice"):
        taker.take(message(1, value=0.5))
    assert [tick for tick, _ in taker.take(message(3))] == [3]


def test_what_comes_after_it_was_passed_over_is_a_conflict():
    taker = stream(gaps=True)
    take_all(taker, [0, 5, 6])
    with pytest.raises(Conflict, match="tick 3 has come after others"):
        taker.take(message(3))


def test_what_is_older_than_all_that_is_kept_is_nothing():
    taker = stream()
    take_all(taker, list(range(HISTORY + 2)))
    assert taker.take(message(1, value=0.5)) == ()
    with pytest.raises(Conflict):
        taker.take(message(2, value=0.5))


def test_a_stream_that_goes_on_takes_what_follows():
    taker = stream()
    taker.go_on_after(41)
    assert taker.take(message(40)) == ()
    with pytest.raises(ValueError, match="of tick 43; that of tick 42 is needed next"):
        taker.take(message(43))
    assert [tick for tick, _ in taker.take(message(42))] == [42]


def test_of_every_third_tick_the_next_multiple_follows():
    taker = stream()
    taker.every = 3
    taker.go_on_after(7)
    assert taker.next == 9
    assert [tick for tick, _ in taker.take(message(9))] == [9]
    assert taker.next == 12


@pytest.mark.parametrize("stamp", [-PERIOD, -1, 1, PERIOD - 1, PERIOD + 1])
def test_a_stamp_that_is_no_tick_is_refused(stamp):
    with pytest.raises(ValueError, match="no tick of this rate"):
        stream().take(stamped(forms()["joint_torque"], message(0), stamp))


def test_a_number_that_is_not_the_stamps_is_refused():
    form = forms()["activation"]
    other = numbered(form, message(0, topic="activation"), "tick", 1)
    with pytest.raises(ValueError, match="the stamp of tick 0 and the number of another"):
        Stream(form, PERIOD, gaps=False).take(other)


def test_a_last_tick_that_has_been_is_refused():
    form = forms()["joint_torque"]
    taker = stream()
    take_all(taker, [0, 1])
    with pytest.raises(ValueError, match="a last tick that has been"):
        taker.take(numbered(form, message(2), "last_tick", 1))
    assert taker.take(numbered(form, message(2), "last_tick", 2))


@given(st.binary(max_size=400))
def test_bytes_that_are_no_message_are_refused(data):
    taker = stream()
    with pytest.raises(ValueError, match="is no limb_msgs"):
        taker.take(data)
    assert taker.next == 0


@given(st.integers(0), st.integers(1, 255))
def test_a_byte_that_is_changed_changes_no_name(place, flip):
    form, data = forms()["joint_torque"], bytearray(message(0))
    data[form.run.stop + place % (len(data) - form.run.stop)] ^= flip
    try:
        taken = stream().take(bytes(data))
    except ValueError:
        return
    assert taken == ((0, bytes(data)),)
    read = limb_typestore().deserialize_cdr(bytes(data), form.type)
    assert read.joint == ["shoulder", "elbow"]
    assert read.torque.size == 2


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("topic", ["activation", "limb_state", "joint_torque"])
def test_numbers_that_are_not_finite_are_refused(topic, value):
    form = forms()[topic]
    with pytest.raises(ValueError, match="has other values than"):
        form.check(valued(form, message(0, topic=topic), lambda values: value))


@pytest.mark.parametrize("value", [0.0, -0.0, 1.0, 5e-324])
def test_activations_are_shares(value):
    forms()["activation"].check(message(0, value, topic="activation"))


@pytest.mark.parametrize("value", [-5e-324, -0.1, 1.0000000000000002, 2.0])
def test_what_is_no_share_is_no_activation(value):
    with pytest.raises(ValueError, match="numbers from 0 to 1"):
        forms()["activation"].check(message(0, value, topic="activation"))


def test_messages_of_other_topics_are_refused():
    for topic, form in forms().items():
        for other in forms():
            # Both are torques with slopes; what belongs where, their last tick and their numbers tell.
            if other != topic and {topic, other} != {"joint_torque", "impact_torque"}:
                with pytest.raises(ValueError, match="is no "):
                    form.check(message(0, topic=other))


def test_a_message_of_a_tick_has_its_stamp():
    form = forms()["joint_torque"]
    assert at_tick(form, message(0), 7, PERIOD) == message(7)
