"""The picture of a machine: what is believed, what is only counted, and the one big word."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import services.dashboard.view as view_module
from services.bus import Received
from services.config import load_case
from services.dashboard.feed import pump
from services.dashboard.frame import Seen, decode_frame, encode_frame
from services.dashboard.history import PLACE, RESENT
from services.dashboard.sieve import REASONS
from services.messages import OperatorRequest, ReportedLine
from services.wire import encode
from tests.services.dashboard_kit import (
    BLOCK,
    HandFeed,
    block,
    chatter,
    command,
    event,
    force,
    make_view,
    play,
    received,
    report,
    state,
)


def test_a_picture_of_nothing_says_so():
    view, _ = make_view()
    shown = view.state()
    assert (shown["word"], shown["tone"], shown["stale"], shown["age_ms"]) == ("NO DATA", "stale", True, None)
    assert [service["alive"] for service in shown["services"]] == [False] * 3


def test_values_arrive_as_they_were_sent():
    view, clock = make_view()
    wave = 3.0 * np.sin(np.arange(BLOCK))
    play(view, clock, range(20), lambda n: [
        state(n, shift_requested_deg=2.0, shift_applied_deg=1.5), force(n, wave, 2 * wave), report(n, indicator=1.25),
    ])  # fmt: skip
    shown = view.state()
    assert (shown["word"], shown["tone"], shown["stale"]) == ("STABLE", "good", False)
    assert (shown["indicator_n"], shown["limit_n"], shown["limit_source"]) == (1.25, 5.0, "cutting")
    assert (shown["force_x1_min_n"], shown["force_y1p_max_n"]) == (wave.min(), 2 * wave.max())
    assert (shown["spindle_hz"], shown["tooth_pass_hz"], shown["commands_accepted"]) == (20.0, 40.0, 19)
    first, values = view.history.since(-1)
    assert (first, values.shape[1]) == (0, 20)
    for row, value in (("x1_min_n", wave.min()), ("x1_max_n", wave.max()), ("y1p_max_n", 2 * wave.max()),
                       ("indicator_n", 1.25), ("limit_n", 5.0), ("shift_requested_deg", 2.0)):  # fmt: skip
        np.testing.assert_array_equal(values[PLACE[row]], np.float32(value))


def test_lines_and_notes_of_a_report_are_shown_as_far_as_they_make_sense():
    view, clock = make_view()
    lines = tuple(
        ReportedLine(frequency_hz=hz, amplitude_n=2.0, growth_1_per_s=0.0, kind="forced", confidence=0.8)
        for hz in (640.0, 1e300, *range(100, 1000, 50))
    )
    play(view, clock, range(3), lambda n: [state(n), report(n, lines=lines, notes=("speed_unknown", "x" * 900))])
    shown = view.state()
    assert shown["lines"][0] == {"frequency_hz": 640.0, "amplitude_n": 2.0, "kind": "forced", "confidence": 0.8}
    assert len(shown["lines"]) == 7
    assert shown["notes"] == ["speed_unknown", "x" * 40]
    assert shown["detail"].startswith("no line above its limit, speed unknown, x")


def test_marked_millimetres_are_feed_while_chatter_is_reported():
    view, clock = make_view()
    play(view, clock, range(10))
    play(view, clock, range(10, 60), lambda n: [state(n), chatter(n)])
    play(view, clock, range(60, 80))
    assert view.marked_mm == pytest.approx(0.5 * 20.0 * 0.15)
    play(view, clock, range(80, 90), lambda n: [state(n), chatter(n, in_cut=False)])
    assert view.marked_mm == pytest.approx(1.5)


def test_phase_is_that_of_the_last_chatter_frequency():
    view, clock = make_view()
    play(view, clock, range(5), lambda n: [state(n, shift_applied_deg=2.76, shift_requested_deg=1.38), chatter(n)])
    shown = view.state()
    expected = 2 * math.radians(2.76) * 652.0 / 20.0 / math.pi
    assert shown["phase_pi"] == pytest.approx(expected)
    assert shown["phase_requested_pi"] == pytest.approx(expected / 2)
    assert shown["phase_window_pi"] == (0.7, 1.1)


def test_while_chatter_dies_away_its_wandering_frequency_is_not_taken():
    view, clock = make_view()
    play(view, clock, range(10), lambda n: [state(n), chatter(n, indicator=40.0)])
    play(view, clock, range(10, 15), lambda n: [state(n), chatter(n, hz=580.0, indicator=6.0)])
    assert view.state()["last_chatter_hz"] == 652.0


@pytest.mark.parametrize(
    ("changes", "verdict", "word", "tone"),
    [
        ({}, {"state": "chatter", "frequency_hz": 652.0}, "CHATTER", "alarm"),
        ({}, {"state": "suspect"}, "SUSPECT", "warn"),
        ({}, {"state": "idle"}, "IN AIR", "calm"),
        ({}, {"state": "learning"}, "LEARNING", "calm"),
        ({}, {"state": "gap"}, "GAP", "warn"),
        ({}, {"state": "invalid"}, "BAD SIGNAL", "alarm"),
        ({}, {"state": "quiet", "moving": True}, "MOVING", "warn"),
        ({}, {"state": "from a newer version"}, "FROM A NEWER V", "warn"),
        ({}, {"state": ""}, "UNKNOWN", "warn"),
        ({"guard_state": "FAULT"}, {"state": "chatter"}, "FAULT", "alarm"),
        ({"guard_state": "HOLDING"}, {"state": "quiet"}, "HOLDING", "warn"),
        ({"guard_state": "HOLDING"}, {"state": "chatter"}, "CHATTER", "alarm"),
        ({"guard_state": "RETURNING"}, {"state": "quiet"}, "RETURNING", "warn"),
    ],
)
def test_the_word(changes, verdict, word, tone):
    view, clock = make_view()
    play(view, clock, range(3), lambda n: [state(n, **changes), report(n, **verdict)])
    assert (view.word().word, view.word().tone) == (word, tone)


def test_it_says_stale_when_either_side_falls_silent():
    view, clock = make_view()
    play(view, clock, range(5))
    clock.time += 0.51
    assert view.word().word == "STALE"
    assert view.state()["stale"]
    play(view, clock, range(60, 120), lambda n: [state(n), force(n)])
    assert view.word().word == "STALE"
    assert "verdict" in view.word().detail
    play(view, clock, range(120, 125))
    assert view.word().word == "STABLE"
    fresh, clock = make_view()
    play(fresh, clock, range(5), lambda n: [state(n)])
    assert fresh.word().word == "NO MONITOR"
    lonely, clock = make_view()
    play(lonely, clock, range(5), lambda n: [report(n)])
    assert lonely.word().word == "NO MACHINE"


def test_a_run_is_followed_until_it_is_gone_or_silent():
    view, clock = make_view()
    play(view, clock, range(50), lambda n: [state(n), chatter(n)])
    play(view, clock, range(3), lambda n: [state(n, run="r2")])
    assert view.sieve.run == "r1"
    assert view.sieve.refused["another run"] == 3
    view.peer("machine", False)
    play(view, clock, range(3), lambda n: [state(n, run="r2")])
    assert view.sieve.run == "r2"
    assert view.marked_mm == 0.0
    assert view.state()["last_chatter_hz"] is None
    clock.time += 1.1
    play(view, clock, range(3), lambda n: [state(n, run="r3")])
    assert view.sieve.run == "r3"


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (state(20), "from the past"),
        (state(5), "from the past"),
        (report(3), "from the past"),
        (state(10**9), "from the future"),
        (state(0, sample=-5), "implausible"),
        (state(0, sample=2**62), "implausible"),
        (state(21, z_mm=1e300), "implausible"),
        (report(21, indicator=float("inf")), "implausible"),
        (report(21, run="other"), "another run"),
        (state(21, run=""), "implausible"),
        (command(21, run="other"), "another run"),
        (force(21, sample_rate_hz=0.0), "implausible"),
        (force(21, sample_rate_hz=1e12), "implausible"),
        (force(21, np.zeros(50_000), np.zeros(50_000)), "too long"),
        (force(21, np.full(BLOCK, np.nan)), "not finite"),
        (force(21, np.full(BLOCK, 1e300)), "not finite"),
        (OperatorRequest(run="r1", source="operator", sequence=0, request="arm", nonce="n"), "wrong topic"),
    ],
)
def test_nonsense_is_counted_and_changes_no_word(message, reason):
    view, clock = make_view()
    play(view, clock, range(21))
    before = view.state()
    assert view.handle(message) == []
    after = view.state()
    assert after["refused"] == {reason: 1}
    assert after["last_refused"].startswith(reason)
    assert reason in REASONS
    assert (after["word"], after["time_s"], after["indicator_n"]) == tuple(
        before[name] for name in ("word", "time_s", "indicator_n")
    )
    play(view, clock, range(21, 25))
    assert view.word().word == "STABLE"


def test_a_wild_first_message_is_outlived():
    view, clock = make_view()
    view.handle(state(0, sample=2**52))
    play(view, clock, range(300))
    assert view.word().word == "STABLE"
    assert view.state()["time_s"] == pytest.approx(3.0, abs=0.01)


def test_what_comes_late_is_drawn_where_it_belongs():
    view, clock = make_view()
    play(view, clock, [0, 1, 2, 4, 5], lambda n: [state(n), force(n, np.full(BLOCK, float(n)))])
    view.handle(force(3, np.full(BLOCK, 3.0)))
    np.testing.assert_array_equal(view.history.since(-1)[1][PLACE["x1_max_n"]], np.arange(6.0))
    assert not view.sieve.refused


HEARD = st.sampled_from(("machine/state", "force", "chatter", "pitch/command", "event"))
BYTES = st.one_of(st.binary(max_size=80), st.just(b'{"version": 7}'), st.just(b"{"))


@given(st.lists(st.tuples(HEARD, BYTES), max_size=20))
def test_no_bytes_break_the_picture(payloads):
    view, clock = make_view()
    play(view, clock, range(3))
    feed = HandFeed()
    feed.waiting = [Received(topic, payload, "") for topic, payload in payloads]
    pump(feed, view)
    assert view.sieve.refused["unreadable"] == len(payloads)
    assert view.word().word == "STABLE"


@given(st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False, allow_infinity=False), st.text(max_size=30))
def test_no_message_that_can_be_decoded_breaks_the_picture(number, value, text):
    view, clock = make_view()
    play(view, clock, range(3))
    strange = [
        state(3, sample=number, feed_mm_per_rev=value, spindle_speed_rpm=value, run=text, reason=text),
        report(3, first_sample=number, samples=number, indicator=value, frequency_hz=value, state="chatter", run=text),
        report(3, first_sample=270, samples=number, frequency_hz=value, spindle_speed_rpm=value, state=text, kind=text),
        state(3, spindle_speed_rpm=value, shift_applied_deg=value), command(3, shift_deg=value, reason=text),
        event(3, text=text, sample=number), force(3, np.full(BLOCK, value), first_sample=number),
        force(3, np.full(BLOCK, value), sample_rate_hz=value),
    ]  # fmt: skip
    for message in strange:
        view.handle(message)
        frame, _ = encode_frame(view, Seen(), 1, view.state())
        decode_frame(frame)


def test_fields_of_a_newer_minor_version_are_ignored():
    payload = encode(report(0)).replace(b'"state"', b'"weather":[[600.0,3.2]],"mood":"fine","state"')
    view, _ = make_view()
    feed = HandFeed()
    feed.waiting = [Received("chatter", payload, ""), received(state(0))]
    pump(feed, view)
    assert not view.sieve.refused
    assert view.word().word == "STABLE"


def test_the_machine_tells_its_own_case():
    view, clock = make_view()
    feed = HandFeed()
    assert not view.curious()
    for number in range(250):
        clock.time += 0.01
        feed.say(*block(number))
        pump(feed, view)
    assert feed.asked == 2
    other = load_case("thesis-738", {"case.machine": "elsewhere", "planner.max_shift_deg": 3.0})
    feed.text = other.text
    before = view.epoch
    pump(feed, view)
    shown = view.state()
    assert (shown["machine"], shown["case"], shown["title"]) == ("lathe-1", "a case of its own", other.settings.title)
    assert shown["band_hz"] == pytest.approx(other.monitor.band_hz)
    assert shown["shift_limits_deg"] == pytest.approx((0.0, 3.0))
    assert view.epoch > before
    assert not view.curious()
    feed.text = load_case("drift").text
    pump(feed, view)
    assert view.facts.case == "drift"


def test_events_of_several_sources_stand_in_the_order_of_their_time():
    view, _ = make_view()
    feed = HandFeed()
    feed.say(event(7), event(3, source="monitor"), *block(0), event(5, source="controller"))
    pump(feed, view)
    assert [line["time_s"] for _, line in view.events] == [0.03, 0.05, 0.07]


@pytest.mark.parametrize("text", ["", "{}", "[]", "7", "{", "[[1]]", '{"case": 3}', "x" * 10**6, "[" * 10**5])
def test_a_configuration_that_is_none_is_counted(text):
    view, clock = make_view()
    play(view, clock, range(3))
    before = view.facts
    view.learn(text)
    assert view.facts == before
    assert view.sieve.refused == {"unreadable": 1}


def test_events_are_kept_and_cut_to_length():
    view, _ = make_view()
    for number in range(300):
        view.handle(event(number, text="x" * 5000))
    view.handle(event(300, sample=-1))
    assert len(view.events) == 100
    assert view.events[0][1]["text"] == "x" * 300
    assert view.events[-1][1]["time_s"] is None


def test_a_crowd_of_services_is_bounded():
    view, _ = make_view()
    for number in range(1000):
        view.peer(f"service-{number}" * 20, True)
    assert len(view.state()["services"]) <= 16 + 3


def test_a_frame_says_what_is_new_and_repeats_the_end():
    view, clock = make_view()
    play(view, clock, range(100))
    view.handle(event(1))
    frame, seen = encode_frame(view, Seen(), 1, view.state())
    header, columns, levels = decode_frame(frame)
    assert header["columns"]["first"] == 0
    assert columns["indicator_n"].size == 100
    assert levels.shape == (len(header["spectra"]["numbers"]), header["spectra"]["bins"])
    assert header["spectra"]["numbers"] == list(range(1, 20))
    assert [e["id"] for e in header["events"]] == [1]
    play(view, clock, range(100, 105))
    header, columns, _ = decode_frame(encode_frame(view, seen, 2, view.state())[0])
    assert header["columns"]["first"] == 100 - RESENT
    assert columns["x1_max_n"].size == RESENT + 5
    assert header["spectra"]["numbers"] == [20]
    assert header["events"] == []


def test_a_new_run_begins_a_new_picture_for_every_browser():
    view, clock = make_view()
    play(view, clock, range(100))
    _, seen = encode_frame(view, Seen(), 1, view.state())
    clock.time += 2.0
    play(view, clock, range(5), lambda n: [state(n, run="r2")])
    header, columns, _ = decode_frame(encode_frame(view, seen, 2, view.state())[0])
    assert header["epoch"] != seen.epoch
    assert (header["columns"]["first"], columns["indicator_n"].size) == (0, 5)


def test_another_sample_rate_begins_new_traces():
    view, clock = make_view()
    play(view, clock, range(10))
    play(view, clock, range(1000, 1010), lambda n: [force(n, sample_rate_hz=4500.0, first_sample=n * 45, samples=45)])
    assert view.rate_hz == 4500.0
    assert view.spectra.sample_rate_hz == 4500.0


def test_the_view_is_a_node():
    view, _ = make_view()
    assert SimpleNamespace(subscribes=view.subscribes).subscribes == view_module.View.subscribes
    assert view.prepare() is None
    assert all(view.handle(message) == [] for message in block(0))
