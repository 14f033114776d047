"""What an INI file of LinuxCNC says about the axes that shift turret 1; each wrong or missing key has its sentence."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from services.config import Case
from services.errors import InputError

OURS = "ANTIPHASE"
PATH_SPEED_DEG_PER_S = 12.0
"""The shift moves no faster on a control that is reached over a bus: 0.5 mm take 0.2 s, and 40 ms of delay 0.5 deg."""
Ini = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """One axis of the control that carries a part of the shift; mm and s, as the control counts.

    Attributes
    ----------
    letter, joint
        Its name and the number of its joint.
    sign
        1 or -1.
    low_mm, high_mm
        Bounds of the offset.
    soft_low_mm, soft_high_mm
        Soft limits of the axis.
    speed_mm_per_s, acceleration_mm_per_s2
        What the control keeps for the offset.
    """

    letter: str
    joint: int
    sign: int
    low_mm: float
    high_mm: float
    soft_low_mm: float
    soft_high_mm: float
    speed_mm_per_s: float
    acceleration_mm_per_s2: float

    def room(self, position_mm: float, clearance_mm: float) -> str:
        """Return why the largest offset does not fit at a position without offset, empty if it does."""
        low, high = position_mm + self.low_mm - clearance_mm, position_mm + self.high_mm + clearance_mm
        if self.soft_low_mm <= low and high <= self.soft_high_mm:
            return ""
        near, limit = ("MIN", self.soft_low_mm) if low < self.soft_low_mm else ("MAX", self.soft_high_mm)
        return (
            f"axis {self.letter} stands at {position_mm:.3f} mm: an offset of {self.low_mm:g}..{self.high_mm:g} mm "
            f"with {clearance_mm:g} mm of room comes too near [AXIS_{self.letter}]{near}_LIMIT = {limit:g}; "
            "move it away, or narrow the bounds in [ANTIPHASE]"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The INI file of a control that Antiphase shall shift.

    Attributes
    ----------
    path
        The file.
    first, second, feed
        Axis along X1, axis round the bar, and letter of the feed axis.
    angle
        Between the directions of the two axes (rad).
    watchdog_s, fresh_s
        Silence after which the offset freezes: of the bridge, and of whoever instructs it.
    clearance_mm
        Room that stays to the soft limits.
    """

    path: pathlib.Path
    first: Axis
    second: Axis
    feed: str
    angle: float
    watchdog_s: float
    fresh_s: float
    clearance_mm: float

    def to_axes(self, x1: Any, y1: Any, slide_angle: float) -> tuple[Any, Any]:
        """Return the offsets of the two axes (mm) that put tool 1 where slides at `slide_angle` (rad) put it (m)."""
        along = y1 * math.sin(slide_angle) / math.sin(self.angle)
        across = x1 + y1 * math.cos(slide_angle) - along * math.cos(self.angle)
        return 1e3 * self.first.sign * across, 1e3 * self.second.sign * along

    def to_slides(self, first_mm: Any, second_mm: Any, slide_angle: float) -> tuple[Any, Any]:
        """Return the positions of the slides (m) that offsets of the two axes (mm) stand for."""
        across, along = 1e-3 * self.first.sign * first_mm, 1e-3 * self.second.sign * second_mm
        y1 = along * math.sin(self.angle) / math.sin(slide_angle)
        return across + along * math.cos(self.angle) - y1 * math.cos(slide_angle), y1

    def fit(self, case: Case) -> None:
        """Refuse a control that cannot follow the path of a case."""
        radius = 500.0 * float(case.workpiece.cutting_diameter)
        speed = min(math.radians(PATH_SPEED_DEG_PER_S), float(case.path.max_speed))
        for axis, gain in zip((self.first, self.second), self._gains(), strict=True):
            self._enough(axis, "VELOCITY", axis.speed_mm_per_s, gain * radius * speed, "mm/s")
            change = gain * radius * 0.5 * float(case.path.max_acceleration)
            self._enough(axis, "ACCELERATION", axis.acceleration_mm_per_s2, change, "mm/s^2")

    def _gains(self) -> tuple[float, float]:
        """Return how far each axis goes for a unit along the surface."""
        return abs(1.0 / math.tan(self.angle)) + 0.1, 1.0 / math.sin(self.angle)

    def _enough(self, axis: Axis, what: str, has: float, needs: float, unit: str) -> None:
        if has < needs:
            raise InputError(
                f"[AXIS_{axis.letter}]OFFSET_AV_RATIO x MAX_{what}", round(has, 3),
                f"at least {needs:.3g} {unit}, what the path of the shift needs",
            )  # fmt: skip


def read_ini(path: pathlib.Path) -> dict[str, dict[str, str]]:
    """Return sections and keys of an INI file of LinuxCNC; of a repeated key the first, as the control takes it."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError("linuxcnc", str(path), "an INI file of LinuxCNC (`antiphase linuxcnc init DIR`)") from error
    found: dict[str, dict[str, str]] = {}
    section: dict[str, str] = {}
    for line in (line.split("#")[0].split(";")[0].strip() for line in lines):
        if line.startswith("[") and line.endswith("]"):
            section = found.setdefault(line[1:-1].strip(), {})
        elif "=" in line:
            key, value = line.split("=", 1)
            section.setdefault(key.strip(), value.strip())
    return found


def ini_path(folder: pathlib.Path) -> pathlib.Path:
    """Return the INI file of a folder, or the file itself."""
    return folder if folder.suffix == ".ini" else folder / "lathe.ini"


def load_settings(folder: pathlib.Path) -> Settings:
    """Read and check the INI file of a folder.

    Raises
    ------
    InputError
        Naming section and key, what stands there, and the rule.
    """
    path = ini_path(folder)
    ini = read_ini(path)
    if OURS not in ini:
        raise InputError(f"[{OURS}]", None, f"a section of {path} (see `antiphase linuxcnc init DIR`)")
    letters = [_word(ini, OURS, name) for name in ("AXIS_1", "AXIS_2", "FEED_AXIS")]
    _axes_fit(ini, letters)
    if _word(ini, "TRAJ", "LINEAR_UNITS") not in ("mm", "metric"):
        raise InputError("[TRAJ]LINEAR_UNITS", ini["TRAJ"]["LINEAR_UNITS"], "mm")
    angle = math.radians(_number(ini, OURS, "ANGLE_DEG"))
    if not math.radians(10.0) <= angle <= math.radians(170.0):
        raise InputError(f"[{OURS}]ANGLE_DEG", ini[OURS]["ANGLE_DEG"], "in 10..170, or the axes are nearly parallel")
    watchdog, fresh = (_positive(ini, OURS, name) for name in ("WATCHDOG_S", "FRESH_S"))
    if watchdog > 1.0 or fresh > 1.0:
        raise InputError(f"[{OURS}]WATCHDOG_S", watchdog, "at most 1 s, and FRESH_S too")
    _positive(ini, OURS, "SPEED_MM_PER_S")
    _positive(ini, OURS, "ACCELERATION_MM_PER_S2")
    return Settings(
        path=path.resolve(), first=_axis(ini, letters[0], 1), second=_axis(ini, letters[1], 2), feed=letters[2],
        angle=angle, watchdog_s=watchdog, fresh_s=fresh, clearance_mm=_positive(ini, OURS, "CLEARANCE_MM"),
    )  # fmt: skip


def _axes_fit(ini: Ini, letters: list[str]) -> None:
    """Refuse axes that the control does not have, or that are not three."""
    known = _letters(ini)
    for name, letter in zip(("AXIS_1", "AXIS_2", "FEED_AXIS"), letters, strict=True):
        if letter not in known:
            raise InputError(f"[{OURS}]{name}", letter, f"one of the axes of [KINS]KINEMATICS: {', '.join(known)}")
    if len(set(letters)) < 3:
        raise InputError(f"[{OURS}]AXIS_1, AXIS_2, FEED_AXIS", " ".join(letters), "three different axes")


def _letters(ini: Ini) -> str:
    """Return the axes in the order of their joints."""
    kinematics = _word(ini, "KINS", "KINEMATICS")
    if not kinematics.startswith("trivkins"):
        raise InputError("[KINS]KINEMATICS", kinematics, "trivkins: each axis of the turret must be one joint")
    given = kinematics.partition("coordinates=")[2].split(" ")[0].upper()
    return given or _word(ini, "TRAJ", "COORDINATES").replace(" ", "").upper()


def _axis(ini: Ini, letter: str, number: int) -> Axis:
    section = f"AXIS_{letter}"
    ratio = _number(ini, section, "OFFSET_AV_RATIO")
    if not 0.0 < ratio <= 0.9:
        raise InputError(
            f"[{section}]OFFSET_AV_RATIO", ratio,
            "above 0 and at most 0.9, the share of speed and acceleration that is kept for the offset (0.2 is usual); "
            "with 0 the control takes no offset on this axis",
        )  # fmt: skip
    sign, low, high = (_number(ini, OURS, f"{name}_{number}{unit}") for name, unit in _BOUNDS)
    if sign not in (1.0, -1.0):
        raise InputError(f"[{OURS}]SIGN_{number}", sign, "1 or -1")
    if not low < 0.0 < high:
        raise InputError(f"[{OURS}]LOW_{number}_MM, HIGH_{number}_MM", (low, high), "on both sides of 0")
    soft = _number(ini, section, "MIN_LIMIT"), _number(ini, section, "MAX_LIMIT")
    room = _number(ini, OURS, "CLEARANCE_MM")
    if soft[1] - soft[0] < high - low + 2.0 * room:
        raise InputError(f"[{section}]MIN_LIMIT, MAX_LIMIT", soft, f"wider than {low:g}..{high:g} mm with room")
    return Axis(
        letter=letter, joint=_letters(ini).index(letter), sign=int(sign), low_mm=low, high_mm=high,
        soft_low_mm=soft[0], soft_high_mm=soft[1],
        speed_mm_per_s=ratio * _positive(ini, section, "MAX_VELOCITY"),
        acceleration_mm_per_s2=ratio * _positive(ini, section, "MAX_ACCELERATION"),
    )  # fmt: skip


_BOUNDS = (("SIGN", ""), ("LOW", "_MM"), ("HIGH", "_MM"))


def _word(ini: Ini, section: str, key: str) -> str:
    value = ini.get(section, {}).get(key)
    if value is None:
        hint = " (0.2 is usual: the share of speed and acceleration kept for the offset)" if "RATIO" in key else ""
        raise InputError(f"[{section}]{key}", None, f"given in the INI file{hint}")
    return value


def _number(ini: Ini, section: str, key: str) -> float:
    text = _word(ini, section, key)
    try:
        value = float(text)
    except ValueError as error:
        raise InputError(f"[{section}]{key}", text, "a number") from error
    if not math.isfinite(value):
        raise InputError(f"[{section}]{key}", text, "a finite number")
    return value


def _positive(ini: Ini, section: str, key: str) -> float:
    value = _number(ini, section, key)
    if value <= 0.0:
        raise InputError(f"[{section}]{key}", value, "above 0")
    return value
