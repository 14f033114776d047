"""A folder with everything that LinuxCNC needs to be shifted: `antiphase linuxcnc init` writes, `doctor` checks it."""

from __future__ import annotations

import math
import pathlib
from importlib.resources import files
from string import Template

from services.config import Case
from services.errors import InputError
from services.machines.linuxcnc.settings import Settings, ini_path, load_settings, read_ini

TEMPLATES = files("services.machines.linuxcnc") / "template"
FILES = ("lathe.ini", "motion.hal", "antiphase.hal", "drives.hal", "headless.py", "turn.ngc", "tool.tbl", "lathe.var")
TRAVEL_MM = 200.0
RATIO = "0.2"


def init_folder(folder: pathlib.Path, case: Case, angle_deg: float | None = None) -> list[pathlib.Path]:
    """Write INI, HAL, display and part program for a case; nothing that is there is overwritten.

    Parameters
    ----------
    folder
        Where; made if missing.
    case
        Whose limits and feed they get.
    angle_deg
        Between the directions of the two axes (deg); None: each axis is one of the skewed slides.
    """
    there = [name for name in FILES if (folder / name).exists()]
    if there:
        raise InputError("dir", str(folder), f"a folder without {there[0]}: what is there is not overwritten")
    angle = math.degrees(case.drives.axis_angle) if angle_deg is None else angle_deg
    if not 10.0 <= angle <= 170.0:
        raise InputError("angle-deg", angle, "in 10..170, or the axes are nearly parallel")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in compose(case, math.radians(angle)).items():
            (folder / name).write_text(text, encoding="utf-8")
            if name.endswith(".py"):
                (folder / name).chmod(0o755)
    except OSError as error:
        raise InputError("dir", str(folder), f"a folder that can be written to ({error.strerror})") from error
    load_settings(folder).fit(case)
    return [folder / name for name in FILES]


def compose(case: Case, angle: float) -> dict[str, str]:
    """Return the text of each file for a case; `angle` (rad) is that between the two axes."""
    limits, cutting, settings = case.limits, case.cutting, case.settings
    reach = limits.dx + limits.dy * abs(1.0 / math.tan(angle)), limits.dy / math.sin(angle)
    if math.isclose(angle, limits.axis_angle):
        reach = min(reach[0], limits.x1), min(reach[1], limits.y1)
    words = {
        "first": "X", "second": "Y", "feed": "Z", "angle": f"{math.degrees(angle):.9g}",
        "high_1": f"{1e3 * reach[0]:.4f}", "high_2": f"{1e3 * reach[1]:.4f}",
        "speed": f"{1e3 * limits.slide_speed:g}", "acceleration": f"{1e3 * limits.slide_acceleration:g}",
    }  # fmt: skip
    length = 1e3 * cutting.feed_per_rev * cutting.spindle_hz * (settings.cut_time + 1.0)
    program = {
        "air_s": f"{settings.air_time:g}", "length": f"{length:g}",
        "feed": f"{60e3 * cutting.feed_per_rev * cutting.spindle_hz:g}",
    }  # fmt: skip
    axes = "".join(
        fill("axis.part", letter=letter, number=str(k), low=f"{-TRAVEL_MM:g}", high=f"{TRAVEL_MM:g}", ratio=RATIO)
        for k, letter in enumerate("XYZ")
    )
    return {
        "lathe.ini": fill("lathe.ini", **words) + axes,
        "motion.hal": fill("motion.hal"),
        "antiphase.hal": antiphase_hal("XYZ", (0, 1, 2)),
        "drives.hal": fill("drives.hal"),
        "headless.py": fill("headless.py"),
        "turn.ngc": fill("turn.ngc", **program),
        "tool.tbl": "",
        "lathe.var": "",
    }


def antiphase_hal(letters: str, joints: tuple[int, int, int]) -> str:
    """Return the HAL of the offsets for the axis along X1, the one round the bar, and the feed axis."""
    names = dict(zip("ab", letters.lower(), strict=False)) | dict(zip("ijk", map(str, joints), strict=True))
    return fill("antiphase.hal", **names)


def fill(name: str, **words: str) -> str:
    """Return a template with its words."""
    return Template((TEMPLATES / name).read_text(encoding="utf-8")).substitute(words)


def missing_lines(settings: Settings) -> list[str]:
    """Return what the HAL files of a folder lack of the bounds and the watchdog."""
    folder = settings.path.parent
    ini = settings.path.read_text(encoding="utf-8")
    names = [line.split("=", 1)[1].split()[0] for line in ini.splitlines() if line.strip().startswith("HALFILE")]
    there: set[str] = set()
    for name in names:
        path = folder / name
        if not path.exists():
            return [f"{name}, which [HAL]HALFILE names"]
        there |= {_plain(line) for line in path.read_text(encoding="utf-8").splitlines()}
    kinematics = read_ini(ini_path(settings.path))["KINS"]["KINEMATICS"].partition("coordinates=")[2].split(" ")[0]
    joint = kinematics.upper().index(settings.feed) if settings.feed in kinematics.upper() else 2
    wanted = antiphase_hal(
        settings.first.letter + settings.second.letter + settings.feed,
        (settings.first.joint, settings.second.joint, joint),
    )
    return [line for line in map(_plain, wanted.splitlines()) if line and line not in there]


def _plain(line: str) -> str:
    return " ".join(line.split("#")[0].split())
