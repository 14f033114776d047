"""The adapters there are, by name, each made and ended in one place."""

from __future__ import annotations

import os
import pathlib
import tempfile
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

from services.config import Case
from services.errors import InputError, RefusalError
from services.nodes.machine import MachineNode

ADAPTERS = ("simulator", "linuxcnc")


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Which machine, and how it is reached.

    Attributes
    ----------
    adapter
        One of `ADAPTERS`.
    folder
        Of the control; None: one of our own for as long as it runs.
    attach
        Whether the control is running already, and is left running.
    trace
        File for what the control did in every servo cycle.
    """

    adapter: str = "simulator"
    folder: pathlib.Path | None = None
    attach: bool = False
    trace: pathlib.Path | None = None

    def __post_init__(self) -> None:
        """Check what belongs together."""
        if self.adapter not in ADAPTERS:
            raise InputError("adapter", self.adapter, f"one of {', '.join(ADAPTERS)}")
        if self.adapter == "simulator":
            for name in ("folder", "attach", "trace"):
                if getattr(self, name):
                    given = "linuxcnc" if name == "folder" else name
                    raise InputError(given, str(getattr(self, name)), "given with --adapter linuxcnc only")
        elif self.attach and self.folder is None:
            raise InputError("attach", True, "given with --linuxcnc DIR, the folder of the running control")

    def options(self) -> tuple[str, ...]:
        """Return the same as options of `antiphase machine`."""
        if self.adapter == "simulator":
            return ()
        given = (("--linuxcnc", self.folder), ("--trace", self.trace))
        named = (word for name, path in given if path is not None for word in (name, str(path)))
        return ("--adapter", self.adapter, *named, *(("--attach",) if self.attach else ()))


def check_choice(choice: Choice, case: Case) -> None:
    """Refuse a folder of LinuxCNC that cannot shift the turret of a case, before anything is started."""
    if choice.adapter == "simulator" or choice.folder is None:
        return
    from services.machines.linuxcnc.folder import missing_lines
    from services.machines.linuxcnc.settings import load_settings

    settings = load_settings(choice.folder)
    settings.fit(case)
    if missing := missing_lines(settings):
        raise InputError(
            "linuxcnc", str(choice.folder),
            f"a folder whose HAL keeps bounds and watchdog in the servo thread: {len(missing)} lines are missing, "
            f"first: {missing[0]} (compare `antiphase linuxcnc init DIR`)",
        )  # fmt: skip


@contextmanager
def open_machine(choice: Choice, case: Case, seed: int, run: str) -> Generator[MachineNode]:
    """Make a machine, and end whatever was started for it."""
    if choice.adapter == "simulator":
        yield MachineNode(case, seed, run)
        return
    from services.machines.linuxcnc.control import Control, absent
    from services.machines.linuxcnc.folder import init_folder
    from services.machines.linuxcnc.link import Link
    from services.machines.linuxcnc.node import LinuxcncNode
    from services.machines.linuxcnc.settings import load_settings

    with ExitStack() as stack:
        folder = choice.folder
        if folder is None:
            folder = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="antiphase-lathe-")))
            init_folder(folder, case)
        check_choice(replace(choice, folder=folder), case)
        settings = load_settings(folder)
        environment = dict(os.environ)
        if choice.attach and (why := absent(settings)):
            raise RefusalError(why)
        if not choice.attach:
            environment = stack.enter_context(Control(settings)).environment
        link = Link(settings, environment)
        stack.callback(link.close)
        link.ready()
        program = settings.path.parent / "turn.ngc"
        if not choice.attach:
            link.bring_up()
        own = not choice.attach and program.exists()
        node = LinuxcncNode(case, seed, run, link, str(program) if own else None)
        stack.callback(node.close)
        yield node
        if choice.trace is not None:
            node.trace.write(choice.trace)
