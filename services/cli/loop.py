"""Verbs that cut: `run`, `demo` and `simulate`."""

from __future__ import annotations

import math
import pathlib
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Any, Literal

import typer
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from services.cli.app import (
    INTERRUPTED,
    Adapter,
    JsonFlag,
    LinuxcncDir,
    OutDir,
    Seed,
    Sensitivity,
    app,
    console,
    emit,
    positive,
    require,
    sensitive,
    writable_folder,
)
from services.clock import WallClock
from services.closed_loop import Outcome, judge, run_loop
from services.config import Case, load_case
from services.doubts import notes
from services.effects import with_advice
from services.errors import InputError
from services.messages import Message
from services.reproduce.plant import MODELS, PlantName
from services.tape import Tape

WIDEST_DEG = 20.0
"""Shift up to which a tool keeps its angles."""
CaseName = Annotated[str, typer.Argument(help="Name of a shipped case, or path of a TOML file.")]
ArmAfter = Annotated[
    float, typer.Option("--arm-after-s", help="Arm the guard this late: lets the chatter grow first (s).")
]


AdviseOnly = Annotated[
    bool, typer.Option("--advise-only", help="Say what the controller would command, command nothing, never arm.")
]
PlantModel = Annotated[
    str, typer.Option("--plant", help="lumped (fast), or surface: a map of the surface that each tool cuts (slower).")
]


def model_of(plant: str) -> PlantName:
    """Return the name of a plant, or say which there are."""
    if plant == "lumped" or plant == "surface":
        return plant
    raise InputError("plant", plant, "lumped or surface")


@contextmanager
def progress_bar(what: str) -> Generator[Callable[[float], None]]:
    """Show a bar on a terminal, nothing elsewhere."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)


@contextmanager
def finishing() -> Generator[None]:
    """Let the first Ctrl-C pass, so that what was seen is written; the second one counts."""
    before = signal.getsignal(signal.SIGINT)

    def once(*_: object) -> None:
        signal.signal(signal.SIGINT, before)
        console.print("finishing the report; Ctrl-C again gives it up", highlight=False)

    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, once)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, before)


@app.command()
def run(
    case: CaseName = "thesis-652",
    seed: Seed = None,
    out: OutDir = None,
    arm_after_s: ArmAfter = 0.0,
    sensitivity: Sensitivity = None,
    advise_only: AdviseOnly = False,
    as_json: JsonFlag = False,
) -> int:
    """Run the closed loop of a case in lockstep in one process, as fast as it can."""
    config, used, armed = _announced(case, seed, arm_after_s, sensitivity, as_json, advise_only)
    return _loop(config, used, out, armed, as_json, advise_only)


@app.command()
def demo(
    case: CaseName = "thesis-652",
    seed: Seed = None,
    out: OutDir = None,
    arm_after_s: ArmAfter = 0.0,
    sensitivity: Sensitivity = None,
    advise_only: AdviseOnly = False,
    adapter: Adapter = "simulator",
    linuxcnc: LinuxcncDir = None,
    as_json: JsonFlag = False,
) -> int:
    """Show a case from chatter to silence: machine, monitor and controller as three processes in real time.

    `demo linuxcnc` is `demo thesis-652 --adapter linuxcnc`: the turret's motion is LinuxCNC's own.
    """
    from services.demo import run_demo
    from services.machines.adapters import Choice, check_choice
    from services.recording_writer import McapRecorder

    case, adapter = ("thesis-652", "linuxcnc") if case == "linuxcnc" else (case, adapter)
    choice = Choice(adapter=adapter, folder=linuxcnc)
    config, used, armed = _announced(case, seed, arm_after_s, sensitivity, as_json, advise_only)
    check_choice(choice, config)
    name = config.name if adapter == "simulator" else f"{config.name}-{adapter}"
    folder = writable_folder(out or pathlib.Path("runs") / name) or pathlib.Path()
    clock = WallClock()
    started = clock.now()
    path = folder / "run.mcap"
    choice = replace(choice, trace=None if adapter == "simulator" else folder / "linuxcnc.csv")
    with progress_bar(case) as progress, McapRecorder(path, _metadata(config, used, "wall")) as recorder:

        def hear(topic: str, payload: bytes, encoding: str, _: Message) -> None:
            recorder.write(topic, payload, encoding, round(1e9 * (clock.now() - started)))

        seen = run_demo(
            case, config, used, clock=clock, say=_say, arm_after_s=armed, hear=hear, progress=progress,
            lasts=choice.options(), advise_only=advise_only,
        )  # fmt: skip
    if recorder.failure:
        _say(f"{path.name} is incomplete: {recorder.failure}")
    ran_s = clock.now() - started
    extra, drawn = _followed(choice.trace, seen.services.get("machine", {}))
    return conclude(
        config, used, seen.tape, seen.interrupted, folder, ran_s, as_json, recorded=[path, *drawn], extra=extra,
        more=extra.get("said", ""),
    )  # fmt: skip


def _followed(trace: pathlib.Path | None, machine: dict[str, Any]) -> tuple[dict[str, Any], list[pathlib.Path]]:
    """Draw how the control followed, and return what there is to say of it."""
    if trace is None or not trace.exists():
        return {}, []
    from services.figures.linuxcnc import write_linuxcnc_figure
    from services.machines.linuxcnc.trace import judge_trace, read_trace

    followed = judge_trace(read_trace(trace), machine)
    return followed, [trace, write_linuxcnc_figure(read_trace(trace), trace.with_suffix(".png"))]


def _say(text: str) -> None:
    console.print(text, markup=False, highlight=False)


def _announced(
    name: str, seed: int | None, arm_after_s: float, sensitivity: float | None, as_json: bool, advise_only: bool
) -> tuple[Case, int, float | None]:
    """Return the case, the seed and when to arm, after checking and saying what is about to happen."""
    case = load_case(name, sensitive(sensitivity))
    longest = case.settings.air_time + case.settings.cut_time
    require("arm-after-s", arm_after_s, f"in 0..{longest:g} s, the length of the case", 0 <= arm_after_s <= longest)
    used = case.settings.seed if seed is None else seed
    advises = advise_only or (case.job is not None and bool(case.job.advise_only))
    if not as_json:
        armed = "the guard is armed " + ("at once" if arm_after_s == 0 else f"after {arm_after_s:g} s")
        armed = "advise only: nothing is commanded, the guard stays OFF" if advises else armed
        _say(f"{case.name}: {case.settings.title}\nseed {used}; {armed}")
    return case, used, None if advises else arm_after_s


def _loop(
    case: Case, used: int, out: pathlib.Path | None, arm_after_s: float | None, as_json: bool, advise_only: bool
) -> int:
    folder = writable_folder(out)
    clock = WallClock()
    started = clock.now()
    with progress_bar(case.name) as progress:
        tape, interrupted = run_loop(
            case, used, clock, arm_after_s=arm_after_s, progress=progress, advise_only=advise_only
        )
    ran_s = clock.now() - started
    recorded = [_record(case, used, tape, folder / "run.mcap")] if folder else []
    return conclude(case, used, tape, interrupted, folder, ran_s, as_json, recorded=recorded)


def _record(case: Case, seed: int, tape: Tape, path: pathlib.Path) -> pathlib.Path:
    """Write what was said in lockstep, stamped with the time of the samples."""
    from services.nodes.recorder import RecorderNode
    from services.recording_writer import McapRecorder

    with McapRecorder(path, _metadata(case, seed, "samples")) as recorder:
        node = RecorderNode(recorder, "", case.settings.sample_rate_hz)
        for message in tape.log:
            node.handle(message)
    if recorder.failure:
        console.print(f"{path.name} is incomplete: {recorder.failure}", style="bold red", markup=False)
    return path


def _metadata(case: Case, seed: int, clock: Literal["wall", "samples"]) -> dict[str, str]:
    from services.recording_writer import run_metadata
    from services.tape import versions

    release = versions()["antiphase"]
    return run_metadata(
        case=case.name, seed=seed, run="", config=case.text, digest=case.digest, version=release, clock=clock
    )


def conclude(
    case: Case,
    seed: int,
    tape: Tape,
    interrupted: bool,
    out: pathlib.Path | None,
    wall_s: float,
    as_json: bool,
    *,
    recorded: Sequence[pathlib.Path] = (),
    extra: dict[str, Any] | None = None,
    more: str = "",
    judged: Callable[[], Outcome] | None = None,
) -> int:
    """Evaluate, draw and write what was seen; only a second Ctrl-C stops this. `judged` does without the twin."""
    clock = WallClock()
    started = clock.now() - wall_s
    with finishing():
        outcome = judged() if judged else judge(case, seed, tape, interrupted=interrupted)
        if out is not None:
            outcome = replace(outcome, record=with_advice(case, outcome.record))
        figures = _draw(outcome, out)
        outcome = replace(outcome, summary=replace(outcome.summary, total_wall_s=clock.now() - started))
        written = [*recorded, *figures, *_write(outcome, out)]
    text = words(outcome) + more
    if written:
        text += "".join(f"\nwrote {path}" for path in written)
    emit({**outcome.summary.as_dict(), **(extra or {}), "written": written}, text, as_json)
    return INTERRUPTED if outcome.record.interrupted else 0


def _draw(outcome: Outcome, out: pathlib.Path | None) -> list[pathlib.Path]:
    if out is None or not outcome.record.has_twin:
        return []
    from services.figures import write_figures

    return write_figures(outcome.record, outcome.summary, out)


def _write(outcome: Outcome, out: pathlib.Path | None) -> list[pathlib.Path]:
    if out is None:
        return []
    from services.report import write_report, write_summary

    reports = [write_report(outcome.record, outcome.summary, out)] if outcome.record.has_twin else []
    return [write_summary(outcome.summary, out), *reports]


def words(outcome: Outcome) -> str:
    """Return what happened, as a machinist would say it."""
    from services.sentences import verdict

    said = verdict(outcome.record, outcome.summary)
    return "\n".join((said.title, *said.sentences)) + notes(outcome.summary.doubts)


@app.command()
def simulate(
    case: CaseName = "thesis-652",
    shift_deg: Annotated[float, typer.Option("--shift-deg", help="Shift at which turret 1 stands (deg).")] = 0.0,
    feed_length_mm: Annotated[
        float | None, typer.Option("--feed-length-mm", help="Length of the cut (mm); default: the case's.")
    ] = None,
    plant: Annotated[
        str | None, typer.Option("--plant", help="lumped, or surface (a map of the surface); default: the case's.")
    ] = None,
    seed: Seed = None,
    out: OutDir = None,
    as_json: JsonFlag = False,
) -> None:
    """Cut without control: what the bar does at one shift."""
    from services.open_cut import OpenCut, cut_open

    config = load_case(case, None if plant is None else MODELS[model_of(plant)])
    limit = min(math.degrees(config.limits.shift), WIDEST_DEG)
    require("shift-deg", shift_deg, f"within +-{limit:g} deg, the limit of the case", abs(shift_deg) <= limit)
    length = _feed_length(config, feed_length_mm)
    folder = writable_folder(out)
    used = config.settings.seed if seed is None else seed
    with progress_bar(case):
        result: OpenCut = cut_open(config, used, math.radians(shift_deg), length)
    answer = result.as_dict() | {"case": config.name, "seed": used, "shift_deg": shift_deg}
    if folder is not None:
        answer["written"] = result.write(folder)
    emit(answer, result.words() + notes(result.doubts), as_json)


def _feed_length(case: Case, length_mm: float | None) -> float:
    cutting, settings = case.cutting, case.settings
    if length_mm is None:
        return cutting.feed_per_rev * cutting.spindle_hz * settings.cut_time
    room = 1e3 * (case.workpiece.length - settings.start_position)
    positive("feed-length-mm", length_mm, "mm")
    return 1e-3 * require("feed-length-mm", length_mm, f"at most {room:g} mm, what the bar has", length_mm <= room)
