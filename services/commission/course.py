"""The course of a commissioning: which step comes next, and what becomes of those behind it when one is repeated."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from services.commission.drives import BAND_HZ
from services.commission.lockstep import Place
from services.commission.state import MACHINE, STATE, Done, State, load_state, save_state, write_machine
from services.commission.steps import NAMES, STEPS, Bench, Step
from services.config import Case, load_case
from services.errors import InputError, RefusalError

Ask = Callable[[Step], bool]
Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One commissioning.

    Attributes
    ----------
    name
        The case as on the command line.
    folder
        Where everything is kept.
    seed
        Of the simulated machine; None for the case's.
    sweeps
        Files with swept sines, by axis.
    place
        Where the machine is.
    band_hz
        Of the swept sines in files (Hz).
    """

    name: str
    folder: pathlib.Path
    seed: int | None
    sweeps: dict[str, pathlib.Path]
    place: Place = Place()
    band_hz: tuple[float, float] = BAND_HZ

    def begin(self) -> State:
        """Return what was done."""
        return load_state(self.folder, self.name, load_case(self.name))

    def case(self) -> Case:
        """Return the case as far as the steps have made it."""
        path = self.folder / MACHINE
        return load_case(str(path) if path.exists() else self.name)

    def go(self, wanted: Sequence[str], ask: Ask, say: Say) -> State:
        """Carry out steps: those wanted, or all that are open.

        Parameters
        ----------
        wanted
            Names in any order; none for all that are open.
        ask
            Whether a step may be carried out now.
        say
            Told what is done and found.

        Raises
        ------
        InputError
            For a step that there is not.
        RefusalError
            When a step fails, is not allowed, or stands on one that was not done.
        """
        for name in wanted:
            if name not in NAMES:
                raise InputError("step", name, f"one of {', '.join(NAMES)}")
        state = self.begin()
        if state.running:
            say(f"{state.running} was interrupted; nothing of it was kept")
        chosen = [s for s in STEPS if (s.name in wanted if wanted else not _is_done(state, s.name))]
        for step in chosen:
            self._one(state, step, ask, say)
        return state

    def _one(self, state: State, step: Step, ask: Ask, say: Say) -> None:
        before = NAMES[: NAMES.index(step.name)]
        missing = [name for name in before if not _is_done(state, name)]
        if missing:
            raise RefusalError(f"{step.name} comes after {', '.join(missing)}", self.answer(state))
        if not ask(step):
            raise RefusalError(f"{step.name} was not allowed; everything before it is kept", self.answer(state))
        state.running = step.name
        save_state(self.folder, state)
        case = self.case()
        seed = case.settings.seed if self.seed is None else self.seed
        try:
            bench = Bench(case=case, seed=seed, place=self.place, sweeps=self.sweeps, band_hz=self.band_hz)
            done = step.do(bench)
        except RefusalError as error:
            done = Done(good=False, words=[error.reason])
        self._keep(state, step, done)
        for word in done.words:
            say(f"  {word}")
        if not done.good:
            raise RefusalError(f"{step.name}: {_wrong(done)}", self.answer(state))

    def _keep(self, state: State, step: Step, done: Done) -> None:
        """Keep what was found; what stands on other values than before is open again."""
        old = state.steps.get(step.name)
        if not done.good or (old is not None and {k: v for k, (v, _) in old.values.items()} != {
            k: v for k, (v, _) in done.values.items()
        }):  # fmt: skip
            for name in NAMES[NAMES.index(step.name) + 1 :]:
                state.steps.pop(name, None)
        state.steps[step.name], state.running = done, ""
        state.steps = {name: state.steps[name] for name in NAMES if name in state.steps}
        write_machine(self.folder, state)
        save_state(self.folder, state)

    def answer(self, state: State) -> dict[str, Any]:
        """Return the keys of the command line."""
        rows = [
            {
                "name": step.name, "title": step.title,
                "state": "open" if (done := state.steps.get(step.name)) is None else "done" if done.good else "failed",
                "found": [] if done is None else done.words,
                "values": {} if done is None else {key: value for key, (value, _) in done.values.items()},
            }
            for step in STEPS
        ]  # fmt: skip
        paths = [path for path in (self.folder / STATE, self.folder / MACHINE) if path.exists()]
        return {
            "case": state.case, "steps": rows,
            "next": next((row["name"] for row in rows if row["state"] != "done"), None),
            "machine": str(self.folder / MACHINE), "written": [str(path) for path in paths],
        }  # fmt: skip


def _is_done(state: State, name: str) -> bool:
    done = state.steps.get(name)
    return done is not None and done.good


def _wrong(done: Done) -> str:
    bad = [word for word in done.words if not word.endswith("as it should be") and "not judged" not in word]
    return "; ".join(bad or done.words)
