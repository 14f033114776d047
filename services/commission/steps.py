"""The steps from a machine that nobody knows to one that is armed; each does one thing and says what it found."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pitch import slide_set_points
from services.commission.drives import BAND_HZ, believed, recorded, swept
from services.commission.lockstep import GRANTED_S, Lockstep, Place
from services.commission.signs import check_positions, check_thrusts
from services.commission.state import Done
from services.config import Case, replaced
from services.learned import Learned
from services.messages import (
    ADVICE,
    BLOCK_S,
    ChatterReport,
    Event,
    ForceBlock,
    MachineState,
    SampleBlock,
    TurretCommand,
)
from services.tape import Tape

TEST_SHIFT = 0.1e-3
"""Along the surface (m)."""
OUT_S, BACK_S, END_S, WAY_S = 0.4, 1.6, 2.4, 0.5
IDLE_S, QUIET_S, DRY_S, CUT_S = 3.0, 4.0, 1.0, 3.0
QUIET_SHARE = 0.1
STILL_DEG = 0.02
"""A turret that moves less stands (deg)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bench:
    """What a step works with.

    Attributes
    ----------
    case
        As far as the steps before it have made it.
    seed
        Of the simulated machine.
    sweeps
        Files with swept sines, by axis; the simulated drive is swept where there is none.
    place
        Where the machine is.
    band_hz
        Of the swept sines in files (Hz).
    """

    case: Case
    seed: int
    sweeps: dict[str, pathlib.Path]
    band_hz: tuple[float, float] = BAND_HZ
    place: Place = Place()


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One step.

    Attributes
    ----------
    name, title
        For the command line and for people.
    moves
        What moves while it is carried out.
    do
        Carries it out.
    """

    name: str
    title: str
    moves: str
    do: Callable[[Bench], Done]


def check_signs(bench: Bench) -> Done:
    """Shift turret 1 by 0.1 mm in air and back, and judge every channel."""
    case = bench.case
    shift = math.asin(TEST_SHIFT / (0.5 * case.workpiece.cutting_diameter))
    away = (math.degrees(shift), round(OUT_S / BLOCK_S), round(BACK_S / BLOCK_S))
    in_air = replaced(case, settings=replace(case.settings, air_time=END_S + GRANTED_S + 1.0))
    with Lockstep(in_air, bench.seed, bench.place, test_shift=away) as loop:
        tape = loop.go(END_S) if loop.reach("arm") else loop.tape
    armed = None if loop.shifter is None else loop.shifter.armed
    why = _held(tape) if armed is None else _not_followed(tape, armed + away[1])
    if armed is None or why is not None:
        return Done(good=False, words=[f"turret 1 did not make the test shift: {why}"])
    rate = case.settings.sample_rate_hz

    def between(start_s: float, stop_s: float) -> slice:
        return slice(round((armed * BLOCK_S + start_s) * rate), round((armed * BLOCK_S + stop_s) * rate))

    before, there = between(0.1, OUT_S), between(1.2, BACK_S)
    out, back = between(OUT_S, OUT_S + WAY_S), between(BACK_S, BACK_S + WAY_S)
    names = [f"{axis}_{kind}_m" for axis in ("x1", "y1") for kind in ("motor_position", "stage_position")]
    series = {name.removesuffix("_m"): tape.series(SampleBlock, name) for name in names}
    travel = {name: float(np.mean(x[there]) - np.mean(x[before])) for name, x in series.items()}
    asked = slide_set_points(shift, case.workpiece.cutting_diameter, case.drives.axis_angle)
    expected: dict[str, float] = {"x1": float(asked[0]), "y1": float(asked[1])}
    thrust = {f"{axis}_thrust": tape.series(SampleBlock, f"{axis}_thrust_n") for axis in ("x1", "y1")}
    gone, come = ({name: x[way] for name, x in thrust.items()} for way in (out, back))
    found = [*check_positions(travel, expected), *check_thrusts(gone, come, expected)]
    return Done(good=not any(one.wrong for one in found), words=[one.words() for one in found])


def _not_followed(tape: Tape, block: int) -> str | None:
    """Return why the shift was not made, None if it was."""
    states: list[MachineState] = tape.of(MachineState)
    if any(s.guard_state == "FAULT" for s in states):
        return next(s.reason for s in states if s.guard_state == "FAULT")
    if all(abs(s.shift_requested_deg) < STILL_DEG for s in states[block:]):
        return _held(tape)
    return None


def _held(tape: Tape) -> str:
    """Return what the guard said against moving."""
    events: list[Event] = tape.of(Event)
    held = [event.text for event in events if event.kind in ("frozen", "request_rejected")]
    states: list[MachineState] = tape.of(MachineState)
    last = states[-1].reason if states else ""
    return "; ".join(dict.fromkeys(held)) or last or "the guard let nothing through"


def run_idle(bench: Bench) -> Done:
    """Listen in air, and learn the limits there."""
    case = bench.case
    in_air = replaced(case, settings=replace(case.settings, air_time=IDLE_S + 1.0))
    with Lockstep(in_air, bench.seed, bench.place) as loop:
        tape = loop.go(IDLE_S)
    reports: list[ChatterReport] = tape.of(ChatterReport)
    settled = round(0.5 * case.settings.sample_rate_hz)
    felt = [float(tape.series(ForceBlock, name)[settled:].mean()) for name in ("force_x1_n", "force_y1p_n")]
    last = reports[-1]
    wrong = [r for r in reports if r.state in ("chatter", "invalid", "gap") or r.in_cut]
    words = [
        f"in air the force shows {last.indicator:.3g} N in the band; limit {last.limit:.3g} N, {last.limit_source}",
        f"strongest line {max(r.line_n or 0.0 for r in reports):.3g} N; noise passes its limit "
        f"{last.false_alarms_per_h or 0.0:.2g} times an hour",
        f"without cutting the slides feel {felt[0]:.2g} N along X1 and {felt[1]:.2g} N along Y1' on average",
    ]
    if wrong:
        words.append(f"{len(wrong)} blocks were no idling ({', '.join(sorted({r.state for r in wrong}))})")
    if last.notes:
        words.append(f"noted: {', '.join(last.notes)}")
    return Done(good=not wrong and last.limit_source == "air", words=words)


def identify(bench: Bench) -> Done:
    """Find what the monitor shall believe of both drives."""
    done = Done(good=True, words=[])
    for axis in ("x1", "y1"):
        path = bench.sweeps.get(axis)
        sweep = swept(bench.case, axis, bench.seed) if path is None else recorded(path, bench.case, axis)
        found = believed(bench.case, axis, sweep, BAND_HZ if path is None else bench.band_hz)
        done.values |= found.values
        done.words.append(found.words)
    return done


def learn_quiet(bench: Bench) -> Done:
    """Cut quietly, and learn the limits of air and cut. The simulated machine takes a tenth of the chip's stiffness."""
    from services.linear_theory import with_stiffness

    air = bench.case.settings.air_time
    with Lockstep(with_stiffness(bench.case, QUIET_SHARE), bench.seed, bench.place) as loop:
        reports: list[ChatterReport] = loop.go(air + QUIET_S).of(ChatterReport)
    last = reports[-1]
    loud = [r for r in reports if r.state == "chatter"]
    words = [
        f"limit {last.limit:.3g} N, of a line {last.line_limit_n or 0.0:.3g} N ({last.limit_source}); "
        f"the cut shows {last.indicator:.3g} N"
    ]
    if loud or not last.in_cut or last.limit_source != "cutting":
        why = f"it chattered at {loud[0].frequency_hz or 0.0:.0f} Hz" if loud else "nothing was learned"
        return Done(good=False, words=[*words, f"this was no quiet cut: {why}; take less depth and repeat the step"])
    learned = Learned.of(loop.monitor.snapshot())
    origin = f"measured: {air:g} s in air and {QUIET_S:g} s of quiet cutting"
    values = {
        f"learned.{key}": (list(value) if isinstance(value, tuple) else value, origin)
        for key, value in _keys_of(learned).items()
    }
    return Done(good=True, words=words, values=values)


def _keys_of(learned: Learned) -> dict[str, Any]:
    from services.sections import known_sections

    return {key: getattr(learned, name) for key, name in known_sections()["learned"].keys().items()}


def run_dry(bench: Bench) -> Done:
    """Cut with the guard in dry run: commands come and are judged, nothing moves."""
    with Lockstep(bench.case, bench.seed, bench.place) as loop:
        loop.reach("dry_run")
        tape = loop.go(bench.case.settings.air_time + DRY_S)
    last: MachineState = tape.of(MachineState)[-1]
    moved = _moved(tape)
    good = last.guard_state == "ARMED" and last.commands_accepted > 0 and last.commands_rejected == 0
    words = [
        f"guard {last.guard_state}: {last.commands_accepted} commands accepted, {last.commands_rejected} rejected, "
        f"{last.commands_late} late; turret 1 moved {moved:.3f} deg"
    ]
    if last.commands_rejected:
        words.append(f"last reason: {last.reason}")
    return Done(good=good and moved < STILL_DEG, words=words)


def advise_cut(bench: Bench) -> Done:
    """Cut with a controller that only advises."""
    with Lockstep(bench.case, bench.seed, bench.place, advise_only=True) as loop:
        tape = loop.go(bench.case.settings.air_time + CUT_S)
    said = [event.text for event in tape.of(Event) if event.kind == ADVICE]
    moved, commands = _moved(tape), len(tape.of(TurretCommand))
    words = said or ["the cut stayed quiet: nothing was advised"]
    words.append(f"{commands} commands were sent; turret 1 moved {moved:.3f} deg")
    return Done(good=not commands and moved < STILL_DEG, words=words)


def arm(bench: Bench) -> Done:
    """Cut with everything armed."""
    with Lockstep(bench.case, bench.seed, bench.place) as loop:
        loop.reach("arm")
        tape = loop.go(bench.case.settings.air_time + CUT_S)
    last: MachineState = tape.of(MachineState)[-1]
    reports: list[ChatterReport] = tape.of(ChatterReport)
    first = next((r for r in reports if r.state == "chatter"), None)
    quiet = all(r.state != "chatter" for r in reports[-round(0.5 / BLOCK_S) :])
    heard = "no chatter" if first is None else f"chatter at {first.frequency_hz or math.nan:.0f} Hz"
    words = [
        f"{heard}; turret 1 at {last.shift_applied_deg:.2f} deg; {'quiet' if quiet else 'still loud'} at the end",
        f"guard {last.guard_state}, {last.commands_rejected} commands rejected",
    ]
    states: list[MachineState] = tape.of(MachineState)
    words += list(dict.fromkeys(state.reason for state in states if state.guard_state == "FAULT"))
    return Done(good=quiet and last.guard_state == "ACTIVE", words=words)


def _moved(tape: Tape) -> float:
    shifts = [state.shift_applied_deg for state in tape.of(MachineState)]
    return max(map(abs, shifts), default=0.0)


STEPS = (
    Step(name="signs", title="Channels and signs, by a test shift of 0.1 mm", do=check_signs,
         moves="turret 1 moves 0.1 mm along the bar's surface and back, in air"),
    Step(name="idle", title="Idle run", do=run_idle, moves="the spindle turns, the tools stand in air"),
    Step(name="identify", title="Drives, from a swept sine", do=identify,
         moves="each slide of turret 1 sways about a slow feed (nothing moves for an axis whose file is given)"),
    Step(name="quiet", title="Limits learned in quiet cutting", do=learn_quiet, moves="both tools take a quiet cut"),
    Step(name="dry-run", title="Dry run: the guard judges, nothing moves", do=run_dry,
         moves="both tools cut; turret 1 is not shifted"),
    Step(name="advise-only", title="A cut with advice only", do=advise_cut,
         moves="both tools cut; turret 1 is not shifted"),
    Step(name="arm", title="Armed", do=arm, moves="both tools cut, and turret 1 is shifted when it chatters"),
)  # fmt: skip
NAMES = tuple(step.name for step in STEPS)
