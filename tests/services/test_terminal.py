"""The picture in a terminal: fits 80 by 24, and says what the page says."""

import io

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from services.config import load_case
from services.dashboard.terminal import Watcher, bar, over_limit, picture, ruler
from services.dashboard.view import View
from services.process import StopSignal
from tests.services.dashboard_kit import FACTS, HandClock, HandFeed, block, chatter, event, make_view, play, state


def lines_of(shown, width=80, height=24):
    console = Console(width=width, height=height, force_terminal=False, color_system=None)
    with console.capture() as capture:
        console.print(shown)
    return capture.get().splitlines()


def screen(view, width=80, height=24):
    known = view.state() | {"bus": "tcp/127.0.0.1:7447", "linked": True}
    return lines_of(picture(known, [line for _, line in view.events], width, height), width, height)


@pytest.mark.parametrize(("width", "height"), [(80, 24), (120, 40), (60, 16)])
def test_it_fits_the_screen_with_the_word_the_numbers_and_the_last_events(width, height):
    view, clock = make_view()
    play(view, clock, range(50), lambda n: [state(n, shift_applied_deg=2.76, z_mm=1e8), chatter(n)])
    for number in range(40):
        view.handle(event(number, text=f"event {number} " + "x" * 400))
    lines = screen(view, width, height)
    assert len(lines) <= height - 1
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for words in ("C H A T T E R", "652.0 Hz", "40.00 of 5.00 N", "2.76 of 0.00 deg", "monitor gone", "event 39"):
        assert words in text, words


def test_of_nothing_it_says_that():
    view, _ = make_view()
    text = "\n".join(screen(view))
    assert "N O   D A T A" in text
    assert "no chatter so far" in text


def test_words_that_look_like_markup_stay_words():
    view, clock = make_view()
    play(view, clock, range(3))
    view.handle(event(1, text="[red]not red[/red]"))
    assert "[red]not red[/red]" in "\n".join(screen(view))


@given(st.one_of(st.none(), st.floats(-1e9, 1e9)), st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.integers(1, 60))
def test_scales_are_as_wide_as_wanted(value, low, high, width):
    assert len(bar(value, low, high, width, marks=(value or 0.0,))) == width
    assert len(ruler(value, (0.7, 1.1), width=width)) == width


def test_the_limit_stands_at_two_thirds():
    assert over_limit(5.0, 5.0) == pytest.approx(2 / 3)
    assert over_limit(0.5, 5.0) == pytest.approx(0.0)
    assert over_limit(0.0, 5.0) is over_limit(None, 5.0) is over_limit(1.0, 0.0) is None


def test_once_waits_until_nothing_is_missing_and_no_longer():
    clock, feed = HandClock(), HandFeed()
    watcher = Watcher(View(FACTS, clock), feed, clock)
    with StopSignal() as stop:
        begin = clock.now()
        assert watcher.once(2.0, stop)["word"] == "NO DATA"
        assert clock.now() == pytest.approx(begin + 2.0, abs=0.03)
        feed.say(*block(0))
        assert watcher.once(0.3, stop)["word"] == "STABLE"
        feed.say(*block(1))
        feed.text = load_case("drift").text
        begin = clock.now()
        assert watcher.once(2.0, stop)["case"] == "drift"
        assert clock.now() < begin + 0.1
        feed.say(*block(2))
    assert "S T A B L E" in "\n".join(lines_of(watcher.draw(80, 24)))


def test_into_a_file_it_says_a_line_each_second():
    class Clock(HandClock):
        def sleep_until(self, moment):
            super().sleep_until(moment)
            feed.say(*block(int(self.time)))
            stop.is_set = self.time > 104.0

    feed, clock, written = HandFeed(), Clock(), io.StringIO()
    with StopSignal() as stop:
        Watcher(View(FACTS, clock), feed, clock).live(Console(file=written, width=40), stop)
    lines = written.getvalue().splitlines()
    assert len(lines) == 6
    assert "NO DATA" in lines[0]
    assert "STABLE: no line above its limit; indicator 1.00 of 5.00 N" in lines[-1]
    assert "\x1b" not in written.getvalue()
