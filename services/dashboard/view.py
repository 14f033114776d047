"""Folds what is said on the bus into one picture; knows the time only from the clock that it is given."""

from __future__ import annotations

import math
from collections import Counter, deque
from typing import Any

import numpy as np

from pitch import regenerative_phase
from services.clock import Clock
from services.dashboard.facts import Facts, told_by
from services.dashboard.history import COLUMN_S, ENVELOPES, PLACE, History, decimate
from services.dashboard.sieve import LARGEST, SILENCE_S, Sieve, plausible
from services.dashboard.spectra import Spectra
from services.dashboard.words import STALE_S, Word, describe
from services.messages import (
    ADVICE,
    ADVICE_OVER,
    ChatterReport,
    Event,
    Floats,
    ForceBlock,
    MachineState,
    Message,
    ReportedLine,
    TurretCommand,
)
from services.wire import topic_of

WINDOW_PI = (0.7, 1.1)
"""Phases between which the published rig was stable, in pi."""
EXPECTED = ("machine", "monitor", "controller")
MOST_SERVICES = 16
MOST_LINES = 8
EVENTS = 100
ASK_S = 2.0
"""How often a machine is asked for its configuration until it tells it."""
MOST_CONFIG = 1 << 18
RATES_HZ = (100.0, 1e6)
LONGEST_BLOCK_S = 5.0
LIVE = (MachineState, ForceBlock, ChatterReport)
TOPICS = tuple(topic_of(kind) for kind in LIVE)


class View:
    """The picture of one machine; a node that answers nothing.

    Parameters
    ----------
    facts
        What is taken to be so until the machine tells its configuration.
    clock
        Monotonic.
    """

    subscribes = (MachineState, ForceBlock, ChatterReport, TurretCommand, Event)

    def __init__(self, facts: Facts, clock: Clock) -> None:
        self.facts, self._clock = facts, clock
        self.sieve = Sieve(clock)
        self.history = History()
        self.rate_hz = facts.sample_rate_hz
        self.spectra = Spectra(self.rate_hz, facts.top_hz)
        self.events: deque[tuple[int, dict[str, Any]]] = deque(maxlen=EVENTS)
        self.event_count = 0
        self.messages: Counter[str] = Counter()
        self.epoch = 0
        self._told_run = ""
        self._asked = -math.inf
        self._alive: dict[str, tuple[bool, float]] = {}
        self._forget()

    def _forget(self) -> None:
        """Begin an empty picture of a new run; events and counts stay."""
        self.machine: MachineState | None = None
        self.report: ChatterReport | None = None
        self.command: TurretCommand | None = None
        self.advice: Event | None = None
        self.force_n: dict[str, float | None] = dict.fromkeys(ENVELOPES)
        self.marked_mm = self._peak_n = 0.0
        self.last_hz: float | None = None
        self.epoch += 1
        self.history.clear()
        self.spectra.clear()

    def prepare(self) -> None:
        """Compile nothing."""

    def handle(self, message: Message) -> list[Message]:
        """Take a message in."""
        if isinstance(message, Event):
            self._event(message)
        elif isinstance(message, LIVE):
            self._live(message)
        elif isinstance(message, TurretCommand):
            if message.run == self.sieve.run and plausible(message.shift_deg) is not None:
                self.command = message
                self.messages[topic_of(TurretCommand)] += 1
            else:
                self.sieve.refuse("another run", f"a command of run {message.run:.40}")
        else:
            self.sieve.refuse("wrong topic", type(message).__name__)
        return []

    def peer(self, service: str, came: bool) -> None:
        """Take in that a sign of life came or went."""
        service = service[:40]
        if service in self._alive or len(self._alive) < MOST_SERVICES:
            self._alive[service] = came, self._clock.now()
        if service == "machine" and not came:
            self.sieve.vacant = True

    def curious(self) -> bool:
        """Whether the machine should be asked for its configuration now."""
        now = self._clock.now()
        if not self.sieve.run or self.told() or now - self._asked < ASK_S:
            return False
        self._asked = now
        return True

    def told(self) -> bool:
        """Whether the machine has told its configuration."""
        return self._told_run == self.sieve.run != ""

    def learn(self, text: str) -> None:
        """Take in the configuration that the machine tells; what cannot be read changes nothing."""
        self._told_run = self.sieve.run
        try:
            if len(text) > MOST_CONFIG:
                raise ValueError(f"{len(text)} characters")
            facts = told_by(text, self.facts.machine)
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            self.sieve.refuse("unreadable", f"configuration: {error}")
            return
        if facts.top_hz != self.facts.top_hz:
            self.spectra = Spectra(self.rate_hz, facts.top_hz)
            self.epoch += 1
        self.facts = facts

    def _live(self, message: MachineState | ForceBlock | ChatterReport) -> None:
        topic = topic_of(type(message))
        if (why := self._unfit(message)) is not None:
            self.sieve.refuse(*why)
            return
        opens = self.sieve.opens(topic, message.run)
        if opens is None:
            return
        if opens:
            self._forget()
        sample = message.sample if isinstance(message, MachineState) else message.first_sample
        if not self.sieve.passes(topic, sample, self.rate_hz, again=isinstance(message, ForceBlock)):
            return
        self.messages[topic] += 1
        if isinstance(message, MachineState):
            self._state(message)
        elif isinstance(message, ForceBlock):
            self._force(message)
        else:
            self._verdict(message)

    def _unfit(self, message: MachineState | ForceBlock | ChatterReport) -> tuple[str, str] | None:
        """Return why a message cannot be meant, None if it can."""
        if isinstance(message, ForceBlock):
            rate, n = message.sample_rate_hz, message.force_x1_n.size
            if not RATES_HZ[0] <= rate <= RATES_HZ[1]:
                return "implausible", f"force at {rate:g} samples per second"
            return ("too long", f"a block of {n} samples") if n > LONGEST_BLOCK_S * rate else None
        names = (name for name in message.__struct_fields__ if isinstance(getattr(message, name), float))
        wrong = next((name for name in names if plausible(getattr(message, name)) is None), None)
        return None if wrong is None else ("implausible", f"{wrong} is {getattr(message, wrong):g}")

    def _column(self, sample: int) -> int:
        return sample // self._per_column

    @property
    def _per_column(self) -> int:
        return max(1, round(COLUMN_S * self.rate_hz))

    def _state(self, state: MachineState) -> None:
        self.machine = state
        column = self._column(state.sample)
        self.history.put(PLACE["shift_requested_deg"], column, state.shift_requested_deg)
        self.history.put(PLACE["shift_applied_deg"], column, state.shift_applied_deg)

    def _force(self, block: ForceBlock) -> None:
        if block.sample_rate_hz != self.rate_hz:
            self.rate_hz = block.sample_rate_hz
            self.history.clear()
            self.spectra = Spectra(self.rate_hz, self.facts.top_hz)
        forces: Floats = np.array([block.force_x1_n, block.force_y1p_n])
        with np.errstate(invalid="ignore"):
            sound = np.abs(forces) <= LARGEST
        if not sound.all():
            self.sieve.refuse("not finite", f"{int((~sound).sum())} samples of force at {block.first_sample}")
            forces[~sound] = np.nan
        for (low, high), values in zip((ENVELOPES[:2], ENVELOPES[2:]), forces, strict=True):
            column, least, greatest = decimate(values, block.first_sample, self._per_column)
            self.history.widen(PLACE[low], column, least, greatest)
            ends = float(np.fmin.reduce(least)), float(np.fmax.reduce(greatest))
            self.force_n[low], self.force_n[high] = plausible(ends[0]), plausible(ends[1])
        self.spectra.update(block.first_sample, forces)

    def _verdict(self, report: ChatterReport) -> None:
        self.report = report
        last = report.first_sample + max(1, min(report.samples, self._per_column)) - 1
        for row, value in (("indicator_n", report.indicator), ("limit_n", report.limit)):
            self.history.put(PLACE[row], self._column(last), value)
        if report.state != "chatter":
            self._peak_n = 0.0
        else:
            self._peak_n = max(self._peak_n, report.indicator)
            if report.indicator >= 0.5 * self._peak_n:  # while it dies away, its frequency wanders
                self.last_hz = report.frequency_hz or self.last_hz
            self.history.put(PLACE["frequency_hz"], self._column(last), report.frequency_hz or math.nan)
            feed = self.machine.feed_mm_per_rev if self.machine is not None and report.in_cut else 0.0
            samples = min(max(report.samples, 0), round(self.rate_hz))
            self.marked_mm += feed * report.spindle_speed_rpm / 60.0 * samples / self.rate_hz

    def _event(self, event: Event) -> None:
        self.messages[topic_of(Event)] += 1
        self.event_count += 1
        sound = event.shift_deg is None or plausible(event.shift_deg) is not None
        if event.kind in (ADVICE, ADVICE_OVER) and event.run == self.sieve.run and sound:
            self.advice = event if event.kind == ADVICE else None
        time_s = plausible(event.sample / self.rate_hz) if event.sample >= 0 else None
        line = {
            "id": self.event_count, "time_s": time_s, "source": event.source[:40], "kind": event.kind[:40],
            "text": event.text[:300],
        }  # fmt: skip
        self.events.append((self.event_count, line))

    def word(self) -> Word:
        """Return the state in one word."""
        return describe(
            self.machine, self.report, self.sieve.age("machine/state"), self.sieve.age("chatter")
        )  # fmt: skip

    def age_s(self) -> float | None:
        """Return the age of the oldest of what should be fresh (s), None while one of them never came."""
        ages = [age for age in map(self.sieve.age, TOPICS) if age is not None]
        return max(ages) if len(ages) == len(TOPICS) else None

    def alive(self) -> dict[str, bool]:
        """Return who shows a sign of life, and who should."""
        return dict.fromkeys(EXPECTED, False) | {name: alive for name, (alive, _) in self._alive.items()}

    def state(self) -> dict[str, Any]:
        """Return everything but the traces as plain values with the unit in each key."""
        facts, word, age = self.facts, self.word(), self.age_s()
        since = {name: self._clock.now() - moment for name, (_, moment) in self._alive.items()}
        return {
            "format": 1, "machine": facts.machine, "case": facts.case, "title": facts.title, "run": self.sieve.run[:80],
            "word": word.word, "tone": word.tone, "detail": word.detail,
            "stale": age is None or age > STALE_S, "age_ms": None if age is None else round(1e3 * age),
            "topic_age_ms": {topic: _ms(self.sieve.age(topic)) for topic in TOPICS},
            "band_hz": facts.band_hz, "shift_limits_deg": facts.shift_limits_deg, "phase_window_pi": WINDOW_PI,
            **self._of_machine(), **self._of_report(), **self._of_phase(), **self._of_command(),
            **{f"force_{name}": value for name, value in self.force_n.items()},
            "marked_length_mm": self.marked_mm,
            "services": [
                {"name": name, "alive": alive, "for_s": since.get(name)} for name, alive in self.alive().items()
            ],
            "messages": dict(self.messages), "refused": dict(self.sieve.refused), "last_refused": self.sieve.last,
        }  # fmt: skip

    def _of_machine(self) -> dict[str, Any]:
        m = self.machine
        names = (
            "spindle_speed_rpm", "z_mm", "feed_mm_per_rev", "diameter_mm", "in_cut", "homed", "feed_hold", "tool",
            "guard_state", "shift_requested_deg", "shift_target_deg", "shift_applied_deg", "commands_accepted",
            "commands_rejected", "commands_late",
        )  # fmt: skip
        known: dict[str, Any] = {name: None if m is None else getattr(m, name) for name in names}
        hz = None if m is None else m.spindle_speed_rpm / 60.0
        known |= {"spindle_hz": hz, "tooth_pass_hz": None if hz is None else hz * self.facts.tools}
        return known | {
            "time_s": None if m is None else m.sample / self.rate_hz,
            "reason": None if m is None else m.reason[:300],
        }  # fmt: skip

    def _of_report(self) -> dict[str, Any]:
        r = self.report
        lines = [] if r is None else [line for line in r.lines[:MOST_LINES] if _sound(line)]
        said = {"state": "state", "kind": "kind", "limit_source": "limit_source"}
        words = {key: None if r is None else (getattr(r, name) or "")[:40] for key, name in said.items()}
        return words | {
            "indicator_n": None if r is None else r.indicator, "limit_n": None if r is None else r.limit,
            "amplitude_n": None if r is None else r.amplitude_n, "confidence": None if r is None else r.confidence,
            "frequency_hz": None if r is None else r.frequency_hz, "last_chatter_hz": self.last_hz,
            "moving": None if r is None else r.moving, "notes": [] if r is None else [n[:40] for n in r.notes[:8]],
            "line_n": None if r is None else r.line_n, "line_limit_n": None if r is None else r.line_limit_n,
            "lines": [
                {"frequency_hz": line.frequency_hz, "amplitude_n": line.amplitude_n, "kind": line.kind[:20],
                 "confidence": line.confidence} for line in lines
            ],
        }  # fmt: skip

    def _of_phase(self) -> dict[str, Any]:
        """Return the phase between the two waves (pi) at the last chatter frequency, as it is and as requested."""
        m, hz = self.machine, self.last_hz
        if m is None or hz is None or m.spindle_speed_rpm < 1.0 or hz < 1.0:
            return {"phase_pi": None, "phase_requested_pi": None}
        spindle_hz = m.spindle_speed_rpm / 60.0
        shifts = {"phase_pi": m.shift_applied_deg, "phase_requested_pi": m.shift_requested_deg}
        return {
            name: regenerative_phase(hz, spindle_hz, 2.0 * math.radians(shift)) / math.pi
            for name, shift in shifts.items()
        }

    def _of_command(self) -> dict[str, Any]:
        c, a, m = self.command, self.advice, self.machine
        shift_deg = a.shift_deg if a is not None else m.shift_requested_deg if m is not None else None
        return {
            "command": None if c is None else c.action,
            "command_shift_deg": None if c is None else c.shift_deg,
            "command_reason": None if c is None else c.reason[:300],
            "advice": None if a is None else a.text[:300],
            "advised_shift_deg": None if a is None else a.shift_deg,
            "effects": self.facts.effects(shift_deg),
        }  # fmt: skip


def _sound(line: ReportedLine) -> bool:
    return None not in map(plausible, (line.frequency_hz, line.amplitude_n, line.confidence))


def _ms(age_s: float | None) -> int | None:
    return None if age_s is None else round(1e3 * min(age_s, 1e6))


__all__ = ["EVENTS", "SILENCE_S", "View"]
