"""The picture of a machine for a terminal of 80 by 24 and more, over ssh too."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from services.clock import Clock
from services.dashboard.feed import Feed, pump
from services.dashboard.view import View
from services.dashboard.words import ALARM, CALM, GOOD, STALE, WARN
from services.process import Stopped, StopSignal

PER_S = 5.0
TELL_S = 1.0
"""How long one look waits for the configuration of the machine."""
TONES = {
    GOOD: "bold white on dark_green", CALM: "bold white on grey30", WARN: "bold black on dark_orange",
    ALARM: "bold white on red3", STALE: "bold white on grey42",
}  # fmt: skip
MOST_PI = 2.0
LABEL = 12
WIDEST, WORDS = 30, 34
"""Longest scale, and room for what stands beside it (characters)."""
AXES = {"force X1": "x1", "force Y1'": "y1p"}


def number(value: float | None, digits: int = 2) -> str:
    """Return a number in words; a dash when it is not known."""
    return "-" if value is None else f"{value:.{digits}f}"


def age(seconds: float | None) -> str:
    """Return an age in words."""
    if seconds is None:
        return "-"
    return f"{1e3 * seconds:.0f} ms" if seconds < 1.0 else f"{seconds:.1f} s"


def bar(value: float | None, low: float, high: float, width: int = WIDEST, marks: tuple[float, ...] = ()) -> str:
    """Return a scale from `low` to `high` with what is filled up to `value`, and marks on it."""
    cells = ["·"] * width
    if value is not None and high > low:
        filled = round(width * min(max((value - low) / (high - low), 0.0), 1.0))
        cells[:filled] = "█" * filled
    for mark in marks:
        if high > low and low <= mark <= high:
            cells[min(int(width * (mark - low) / (high - low)), width - 1)] = "┃"
    return "".join(cells)


def ruler(value: float | None, window: tuple[float, float], most: float = MOST_PI, width: int = WIDEST) -> str:
    """Return a scale from 0 to `most` on which a window and a value are marked."""
    cells = ["█" if window[0] <= most * (k + 0.5) / width <= window[1] else "·" for k in range(width)]
    if value is not None:
        cells[int(min(max(value / most, 0.0), 1.0) * (width - 1))] = "◆"
    return "".join(cells)


def over_limit(indicator: float | None, limit: float | None) -> float | None:
    """Return a place in 0..1 for the indicator: a tenth of its limit at 0, the limit at two thirds, on a log scale."""
    if indicator is None or limit is None or indicator <= 0.0 or limit <= 0.0:
        return None
    return (math.log10(indicator / limit) + 1.0) / 1.5


def picture(state: dict[str, Any], events: list[dict[str, Any]], width: int, height: int) -> RenderableType:
    """Return what the screen shows.

    Parameters
    ----------
    state
        From `View.state`.
    events
        The last ones, the newest at the end.
    width, height
        Of the screen (characters).
    """
    lines = [
        _headline(state, width),
        *_block(state, width),
        *_scales(state, max(8, min(WIDEST, width - LABEL - WORDS))),
        _services(state),
    ]
    room = max(height - len(lines) - 1, 0)
    for event in reversed(events[-room:] if room else []):
        moment = "" if event["time_s"] is None else f"{event['time_s']:9.2f} s "
        lines.append(Text(f"{moment}{event['source']} {event['kind']}: {event['text']}", style="dim"))
    for line in lines:
        line.truncate(width, overflow="ellipsis")
        line.no_wrap = True
    return Group(*lines)


def _headline(state: dict[str, Any], width: int) -> Text:
    left = f"{state['machine']}  {state['case']}  {number(state['time_s'], 1)} s"
    right = f"data age {age(None if state['age_ms'] is None else 1e-3 * state['age_ms'])}"
    right = right if state["linked"] else f"no bus at {state['bus']}"
    return Text(left + right.rjust(max(width - len(left), len(right) + 2)), style="bold")


def _block(state: dict[str, Any], width: int) -> list[Text]:
    style = TONES[state["tone"]]
    word = " ".join(state["word"])
    return [Text(text.center(width), style=style) for text in ("", word, state["detail"][:width], "")]


def _row(label: str, scale: str, words: str, style: str = "") -> Text:
    return Text.assemble((f"{label:<{LABEL}}", "bold"), (scale, style), f"  {words}")


def _scales(state: dict[str, Any], wide: int) -> list[Text]:
    indicator, limit, source = state["indicator_n"], state["limit_n"], state["limit_source"] or "no limit"
    over = indicator is not None and limit is not None and indicator > limit > 0.0
    filled = bar(over_limit(indicator, limit), 0.0, 1.0, wide, marks=(2 / 3,))
    words = f"{number(indicator)} of {number(limit)} N ({source})"
    phase = ruler(state["phase_pi"], state["phase_window_pi"], width=wide)
    return [
        _row("indicator", filled, words, "red" if over else "green"),
        *_forces(state, wide),
        _shift(state, wide),
        _row("phase", phase, f"{number(state['phase_pi'])} of 0..2 pi"),
        _line(state),
        _guard(state),
    ]


def _forces(state: dict[str, Any], wide: int) -> list[Text]:
    rows = {name: (state[f"force_{axis}_min_n"], state[f"force_{axis}_max_n"]) for name, axis in AXES.items()}
    most = max([50.0, *(abs(force) for ends in rows.values() for force in ends if force is not None)])
    return [
        _row(name, bar(high, 0.0, most, wide), f"{number(low, 0)} to {number(high, 0)} N", "cyan")
        for name, (low, high) in rows.items()
    ]


def _shift(state: dict[str, Any], wide: int) -> Text:
    applied, requested, (low, high) = (
        state["shift_applied_deg"],
        state["shift_requested_deg"],
        state["shift_limits_deg"],
    )
    scale = bar(applied, min(low, 0.0), high, wide, marks=(requested or 0.0,))
    return _row("shift", scale, f"{number(applied)} of {number(requested)} deg, {low:g}..{high:g}")


def _line(state: dict[str, Any]) -> Text:
    now, last = state["frequency_hz"], state["last_chatter_hz"]
    kind = state["kind"] or "" if now else "the last one" if last else "no chatter so far"
    return Text.assemble(
        (f"{'frequency':<{LABEL}}", "bold"), f"{number(now or last, 1)} Hz {kind}   ", ("marked ", "bold"),
        f"{number(state['marked_length_mm'], 1)} mm   ", ("spindle ", "bold"),
        f"{number(state['spindle_speed_rpm'], 0)} /min",
    )  # fmt: skip


def _guard(state: dict[str, Any]) -> Text:
    accepted, rejected, late = (state[f"commands_{what}"] or 0 for what in ("accepted", "rejected", "late"))
    words = f"{state['guard_state'] or '-'}  commands {accepted}, rejected {rejected}, late {late}"
    return Text.assemble((f"{'guard':<{LABEL}}", "bold"), words)


def _services(state: dict[str, Any]) -> Text:
    text = Text.assemble((f"{'services':<{LABEL}}", "bold"))
    for service in state["services"]:
        text.append(f"● {service['name']}  " if service["alive"] else f"○ {service['name']} gone  ",
                    "green" if service["alive"] else "red")  # fmt: skip
    refused = sum(state["refused"].values())
    return text.append(f"refused {refused}", "yellow" if refused else "dim")


class Watcher:
    """Keeps a picture up to date from a feed and draws it.

    Parameters
    ----------
    view, feed
        The picture, and what it is fed from.
    clock
        Monotonic.
    """

    def __init__(self, view: View, feed: Feed, clock: Clock) -> None:
        self._view, self._feed, self._clock = view, feed, clock

    def state(self) -> dict[str, Any]:
        """Take in what has come and return the state."""
        pump(self._feed, self._view)
        return self._view.state() | {"bus": self._feed.where, "linked": self._feed.linked()}

    def draw(self, width: int, height: int) -> RenderableType:
        """Return the picture as it is now."""
        return picture(self.state(), [line for _, line in self._view.events], width, height)

    def once(self, wait_s: float, stop: StopSignal) -> dict[str, Any]:
        """Return the state as soon as nothing is missing, or what there is after `wait_s`."""
        until = self._clock.now() + wait_s
        while (state := self.state())["age_ms"] is None and self._clock.now() < until:
            self._pause(stop)
        until = min(until, self._clock.now() + TELL_S)
        while not self._view.told() and self._clock.now() < until:
            self._pause(stop)
            state = self.state()
        return state

    def _pause(self, stop: StopSignal) -> None:
        with stop.waiting():
            self._clock.sleep_until(self._clock.now() + 0.02)

    def live(self, console: Console, stop: StopSignal) -> None:
        """Draw until stopped; the terminal is afterwards what it was before."""
        if not console.is_terminal:
            self._lines(console, stop)
            return
        with Live(console=console, screen=True, auto_refresh=False) as live:
            try:
                while True:
                    live.update(self.draw(*console.size), refresh=True)
                    with stop.waiting():
                        self._clock.sleep_until(self._clock.now() + 1.0 / PER_S)
            except Stopped:
                pass

    def _lines(self, console: Console, stop: StopSignal) -> None:
        """Say one line each second where nothing can be drawn."""
        try:
            while True:
                s = self.state()
                words = f"{number(s['time_s'], 1)} s {s['word']}: {s['detail']}; indicator {number(s['indicator_n'])}"
                words += f" of {number(s['limit_n'])} N, shift {number(s['shift_applied_deg'])} deg"
                console.print(words, markup=False, highlight=False, soft_wrap=True)
                console.file.flush()
                with stop.waiting():
                    self._clock.sleep_until(self._clock.now() + 1.0)
        except Stopped:
            pass
