"""Whatever is missing is counted, and what comes late is taken back."""

from hypothesis import given
from hypothesis import strategies as st

from services.gaps import Gaps
from services.messages import TOPICS, Event, TurretCommand
from tests.services.test_recording_file import message_of


def event(number, run="r", source="machine"):
    return Event(run=run, source=source, sequence=number, sample=0, kind="k", text="t")


@given(st.sets(st.integers(0, 60), min_size=1))
def test_missing_are_the_numbers_between_the_first_and_the_last_heard(numbers):
    gaps = Gaps()
    before = [gaps.see(event(number)) for number in sorted(numbers)]
    lacking = max(numbers) - min(numbers) + 1 - len(numbers)
    assert sum(before) == sum(gaps.missing().values()) == lacking


@given(st.permutations(range(12)))
def test_late_ones_are_taken_back(order):
    gaps = Gaps()
    gaps.see(event(-1))
    for number in order:
        gaps.see(event(number))
    gaps.see(event(12))
    assert gaps.missing() == {}


def test_runs_and_senders_count_apart_and_a_new_beginning_is_no_gap():
    gaps = Gaps()
    for number in (5, 6):
        for source in ("machine", "monitor"):
            for run in ("a", "b"):
                assert gaps.see(event(number, run, source)) == 0
    assert gaps.see(event(1, "a")) == 0
    assert gaps.see(event(3, "a")) == 1
    assert gaps.missing() == {"event": 1}


def test_commands_may_pause_and_every_other_type_may_not():
    for kind in TOPICS.values():
        gaps = Gaps()
        gaps.see(message_of(kind, 0))
        counted = kind.__name__ not in ("OperatorRequest", "TurretCommand")
        assert gaps.see(message_of(kind, 9)) == 8 * counted, kind
    assert TurretCommand not in gaps.missing()


def test_a_long_absence_is_counted_without_remembering_every_number():
    gaps = Gaps()
    gaps.see(event(0))
    assert gaps.see(event(10**12)) == 10**12 - 1
    assert gaps.missing() == {"event": 10**12 - 1}
