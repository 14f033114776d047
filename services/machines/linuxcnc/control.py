"""A LinuxCNC of our own: started without a screen, followed, and gone when it shall be, with all that it left."""

from __future__ import annotations

import contextlib
import os
import pathlib
import re
import shutil
import signal
import subprocess
import tempfile
import uuid
from typing import Self

from services.clock import WallClock
from services.errors import RefusalError
from services.machines.linuxcnc.settings import Settings

LOCK = pathlib.Path("/tmp/linuxcnc.lock")
PYTHON = "/usr/bin/python3"
OLDEST = (2, 9)
NOBODY = "65534"
START_S, STOP_S, LOOK_S = 20.0, 10.0, 0.01
INSTALL = "`apt-get install linuxcnc-uspace` (Debian 12 or newer)"
HURRY = ("nice", "-n", "-10")
"""Before others, where that is allowed: without a real-time kernel the servo thread waits like any other."""
TASKS = ("rtapi_app", "milltask", "linuxcncsvr")
CLOCK = WallClock()


def installed() -> str:
    """Return why LinuxCNC cannot run here, empty if it can."""
    if shutil.which("linuxcnc", path=SYSTEM_PATH) is None:
        return f"LinuxCNC is not installed: {INSTALL}"
    known = subprocess.run([PYTHON, "-c", "import hal, linuxcnc"], capture_output=True, check=False)
    return "" if known.returncode == 0 else f"{PYTHON} does not know LinuxCNC's modules: {INSTALL}"


SYSTEM_PATH = "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"


def old_version(text: str) -> str:
    """Return why a version of LinuxCNC will not do, empty if it will."""
    found = re.match(r"(\d+)\.(\d+)", text)
    if found is not None and (int(found[1]), int(found[2])) >= OLDEST:
        return ""
    wanted = ".".join(map(str, OLDEST))
    return f"this is LinuxCNC {text or 'of unknown version'}; external offsets are relied on from {wanted}: {INSTALL}"


def absent(settings: Settings) -> str:
    """Return why there is no LinuxCNC to attach to, empty if there is one."""
    if why := installed():
        return why
    start = f"start it with `linuxcnc {settings.path}`, switch it on, home all axes"
    return "" if _tasks() else f"no LinuxCNC is running: {start}"


def _tasks() -> list[str]:
    return sorted({name for name in map(_name, _processes()) if name in TASKS})


def running() -> str:
    """Return what says that a LinuxCNC is there already, empty if none is."""
    if there := _tasks():
        return f"another LinuxCNC is running ({', '.join(there)}): end it first, one control per computer"
    if LOCK.exists():
        return f"{LOCK} is left by a LinuxCNC that did not end well, and none is running: remove that file"
    return ""


def orphaned(environ: bytes) -> bool:
    """Whether a process with this environment belongs to a control of ours whose parent is gone: it ends by itself."""
    found = re.search(rb"(?:^|\0)ANTIPHASE_PARENT=(\d+)\0", environ)
    return found is not None and not pathlib.Path(f"/proc/{int(found[1])}").exists()


def _ending() -> bool:
    """Whether a control of ours is about to end."""
    for pid in _processes():
        if _name(pid) in (*TASKS, "linuxcnc"):
            with contextlib.suppress(OSError):
                if orphaned(pathlib.Path(f"/proc/{pid}/environ").read_bytes()):
                    return True
    return False


def _processes() -> list[int]:
    return [int(entry) for entry in os.listdir("/proc") if entry.isdigit()]


def _name(pid: int) -> str:
    """Return what a process is called, empty if it is gone or only waits to be forgotten."""
    with contextlib.suppress(OSError):
        words = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
        name, _, rest = words.partition("(")[2].rpartition(")")
        return "" if rest.split()[0] in "ZX" else name
    return ""


class Control:
    """LinuxCNC without a screen, for as long as this process lives.

    Parameters
    ----------
    settings
        Its INI file, checked.
    """

    def __init__(self, settings: Settings) -> None:
        until = CLOCK.now() + STOP_S
        while _ending() and CLOCK.now() < until:
            CLOCK.sleep_until(CLOCK.now() + LOOK_S)
        if why := installed() or running():
            raise RefusalError(why)
        self._folder = pathlib.Path(tempfile.mkdtemp(prefix="antiphase-linuxcnc-", dir="/tmp"))
        self._folder.chmod(0o777)  # the real-time part gives up the rights of root and opens its pipe here
        self._tag = uuid.uuid4().hex
        self.environment = self._surroundings()
        with (self._folder / "log").open("wb") as log:
            self._process = subprocess.Popen(
                [*HURRY, "linuxcnc", "-r", str(settings.path)], stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                env=self.environment, start_new_session=True, cwd=self._folder,
            )  # fmt: skip

    def _surroundings(self) -> dict[str, str]:
        known = {
            "PATH": SYSTEM_PATH, "LANG": "C", "RUNTESTS": "1", "HOME": str(self._folder),
            "ANTIPHASE_RUN": str(self._folder), "ANTIPHASE_PARENT": str(os.getpid()), "ANTIPHASE_TAG": self._tag,
        }  # fmt: skip
        pipe = {"RTAPI_FIFO_PATH": str(self._folder / ".rtapi_fifo")}
        return known | pipe | ({"RTAPI_UID": NOBODY} if os.getuid() == 0 else {})

    def __enter__(self) -> Self:
        """Wait until it runs."""
        until = CLOCK.now() + START_S
        while not (self._folder / "started").exists():
            if self._process.poll() is not None or CLOCK.now() > until:
                log = self.log()
                self.stop()
                raise RefusalError(f"LinuxCNC did not start: {log}")
            CLOCK.sleep_until(CLOCK.now() + LOOK_S)
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def log(self) -> str:
        """Return the last lines of what it said."""
        lines = (self._folder / "log").read_text(encoding="utf-8", errors="replace").splitlines()
        noise = ("Running with fallback_uid", "Note: Using POSIX")
        return " / ".join([line for line in lines if line.strip() and not line.startswith(noise)][-8:])

    def stop(self) -> None:
        """Let it end; what is still there after a while is ended by force."""
        with contextlib.suppress(OSError):
            (self._folder / "stop").touch()
        try:
            self._process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if left := self.left():
            for pid in left:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(OSError):
                LOCK.unlink()
        shutil.rmtree(self._folder, ignore_errors=True)

    def left(self) -> list[int]:
        """Return the processes that it started and that are still there."""
        return [pid for pid in _processes() if pid != os.getpid() and self._is_ours(pid)]

    def _is_ours(self, pid: int) -> bool:
        with contextlib.suppress(OSError):
            return self._tag.encode() in pathlib.Path(f"/proc/{pid}/environ").read_bytes()
        return False
