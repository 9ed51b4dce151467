"""Nobody waits unseen."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from limb_nodes.exchange.watch import LONGEST_LOOK, SOON, Watch

STEP = LONGEST_LOOK / 2


def said(watch: Watch, seconds: float, done: int, awaited: str = "joint_torque", start: float = 0.0) -> list[float]:
    """At which times something is said while nothing goes on; looks are STEP apart."""
    times = [start + STEP * k for k in range(round(seconds / STEP) + 1)]
    return [now - start for now in times if watch.look(now, done, awaited)]


def test_it_is_said_after_a_second_and_then_less_and_less_often():
    assert said(Watch(limit=100.0, start=9.0), 20.0, done=5) == [1.0, 2.0, 4.0, 8.0, 16.0]


def test_before_the_first_tick_others_have_time_to_start():
    watch = Watch(limit=2.0, start=9.0)
    assert said(watch, 20.0, done=0) == [9.0, 18.0]
    assert not watch.given_up


def test_before_the_first_tick_it_is_given_up_if_that_is_wanted():
    watch = Watch(limit=3.0, start=9.0, patient=False)
    said(watch, 3.0 - STEP, done=0)
    assert not watch.given_up
    said(watch, 2 * STEP, done=0, start=3.0 - STEP)
    assert watch.given_up


def test_what_is_awaited_is_said():
    watch = Watch(limit=100.0, start=9.0)
    words = [watch.look(STEP * k, 5, "joint_torque of muscle_stack") for k in range(round(SOON / STEP) + 1)]
    assert words[:-1] == [""] * (len(words) - 1)
    assert words[-1] == "waits for joint_torque of muscle_stack since 1.0 s"


def test_it_is_given_up_at_the_limit():
    watch = Watch(limit=3.0, start=9.0)
    said(watch, 3.0 - STEP, done=5)
    assert not watch.given_up
    said(watch, 2 * STEP, done=5, start=3.0 - STEP)
    assert watch.given_up


def test_whoever_stood_still_himself_has_not_waited():
    watch = Watch(limit=3.0, start=9.0)
    watch.look(0.0, 5, "joint_torque")
    assert watch.look(1000.0, 5, "joint_torque") == ""
    assert watch.waited == LONGEST_LOOK


@given(st.lists(st.tuples(st.floats(0.0, 2.0), st.booleans(), st.booleans()), max_size=60))
def test_only_waiting_without_progress_counts(looks):
    """looks: time since the last one, whether a tick was done since, whether anything is awaited."""
    watch = Watch(limit=2.0, start=1.0)
    now, done, expected = 0.0, 1, 0.0
    watch.look(now, done, "it")
    for passed, goes_on, awaited in looks:
        now, done = now + passed, done + goes_on
        words = watch.look(now, done, "it" if awaited else "")
        expected = 0.0 if goes_on or not awaited else expected + min(passed, LONGEST_LOOK)
        assert abs(watch.waited - expected) < 1e-9
        assert not words or watch.waited >= SOON
        assert watch.given_up == (watch.waited >= 2.0)
