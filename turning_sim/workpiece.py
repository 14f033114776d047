"""The bar in its chuck: Timoshenko beam on root springs, seen from the tools as modes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import eigh

from turning_sim._check import require

_CANTILEVER_ROOTS = (1.875104068711961, 4.694091132974174, 7.854757438237613)
_ELEMENTS = 64


def cantilever_frequency_hz(
    diameter: float, length: float, mode: int = 1, young_modulus: float = 195e9, density: float = 7930.0
) -> float:
    """Return the bending frequency of a slender round bar held rigidly.

    Yamada, PhD thesis, Keio University, 2017, eq. (6-11), with mass density where the print says specific weight.

    Parameters
    ----------
    diameter : float
        Diameter of the bar (m).
    length : float
        Projection from the chuck (m).
    mode : int
        1 to 3.
    young_modulus : float
        (Pa)
    density : float
        (kg/m3)

    Returns
    -------
    float
        Natural frequency (Hz).
    """
    require(diameter > 0.0, "diameter", "positive", diameter)
    require(length > 0.0, "length", "positive", length)
    require(mode in (1, 2, 3), "mode", "1, 2 or 3", mode)
    require(young_modulus > 0.0, "young_modulus", "positive", young_modulus)
    require(density > 0.0, "density", "positive", density)
    bending_speed = diameter / 4.0 * math.sqrt(young_modulus / density)
    return _CANTILEVER_ROOTS[mode - 1] ** 2 / (2.0 * math.pi * length**2) * bending_speed


@dataclass(frozen=True, slots=True, kw_only=True)
class Chuck:
    """Elastic root of the bar.

    Attributes
    ----------
    lateral_stiffness : float
        (N/m)
    tilt_stiffness : float
        (N m/rad)
    tilt_damping : float
        Dashpot beside the tilt spring (N m s/rad).
    """

    lateral_stiffness: float
    tilt_stiffness: float
    tilt_damping: float = 0.0

    def __post_init__(self) -> None:
        require(self.lateral_stiffness > 0.0, "lateral_stiffness", "positive", self.lateral_stiffness)
        require(self.tilt_stiffness > 0.0, "tilt_stiffness", "positive", self.tilt_stiffness)
        require(self.tilt_damping >= 0.0, "tilt_damping", "at least 0", self.tilt_damping)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """One bending mode seen from the tools, scaled to 1 at the tip.

    Attributes
    ----------
    natural_frequency_hz : float
        Undamped (Hz).
    modal_mass : float
        (kg)
    damping_ratio : float
        Material and chuck together.
    shape : float
        Displacement at the tools per unit displacement of the tip.
    """

    natural_frequency_hz: float
    modal_mass: float
    damping_ratio: float
    shape: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Workpiece:
    """Round bar, stepped where earlier passes or the present one have removed stock.

    Attributes
    ----------
    diameter : float
        Diameter of the stock (m).
    length : float
        Projection from the chuck (m).
    chuck : Chuck
        What holds it.
    damping_ratios : tuple of float
        One for each mode kept, the lowest first.
    turned_diameter : float or None
        Diameter that earlier passes left over `turned_length` (m); None for untouched stock.
    turned_length : float
        Length from the tip that earlier passes turned (m).
    finished_diameter : float or None
        Diameter between the tip and the tools (m); None leaves the stock of the present pass on the bar.
    young_modulus, density : float
        (Pa), (kg/m3)
    poisson_ratio : float
        Enters the shear stiffness only.
    """

    diameter: float
    length: float
    chuck: Chuck
    damping_ratios: tuple[float, ...] = (0.12,)
    turned_diameter: float | None = None
    turned_length: float = 0.1
    finished_diameter: float | None = None
    young_modulus: float = 195e9
    density: float = 7930.0
    poisson_ratio: float = 0.3

    def __post_init__(self) -> None:
        require(self.diameter > 0.0, "diameter", "positive", self.diameter)
        require(self.length > 2.0 * self.diameter, "length", "more than two diameters", self.length)
        require(1 <= len(self.damping_ratios) <= 3, "damping_ratios", "1 to 3 values", self.damping_ratios)
        for ratio in self.damping_ratios:
            require(0.0 < ratio < 1.0, "damping_ratios", "in (0, 1)", ratio)
        for name in ("turned_diameter", "finished_diameter"):
            value = getattr(self, name)
            require(value is None or 0.0 < value <= self.diameter, name, "positive and at most the diameter", value)
        require(0.0 <= self.turned_length < self.length, "turned_length", "in [0, length)", self.turned_length)
        require(self.young_modulus > 0.0, "young_modulus", "positive", self.young_modulus)
        require(self.density > 0.0, "density", "positive", self.density)
        require(0.0 <= self.poisson_ratio < 0.5, "poisson_ratio", "in [0, 0.5)", self.poisson_ratio)

    @property
    def cutting_diameter(self) -> float:
        """Diameter that the tools meet (m)."""
        return self.diameter if self.turned_diameter is None else self.turned_diameter

    def diameter_at(self, distance: float, tool_position: float) -> float:
        """Return the diameter (m) at a distance from the tip with the tools at `tool_position` (m)."""
        if self.finished_diameter is not None and distance < tool_position:
            return self.finished_diameter
        if self.turned_diameter is not None and distance < self.turned_length:
            return self.turned_diameter
        return self.diameter

    def modes(self, tool_position: float) -> tuple[Mode, ...]:
        """Return the modes with the tools at `tool_position` (m from the tip), the lowest first."""
        require(0.0 <= tool_position <= self.length, "tool_position", "in [0, length]", tool_position)
        bar = _bar_modes(self, tool_position if self.finished_diameter is not None else 0.0)
        return tuple(self._mode(bar, k, tool_position) for k in range(len(self.damping_ratios)))

    def table(self, positions: np.ndarray) -> np.ndarray:
        """Return shape, angular frequency, damping and mass of each mode.

        Parameters
        ----------
        positions : ndarray
            Tool positions from the tip (m), shape (n,).

        Returns
        -------
        ndarray
            Shape (n, modes, 4).
        """
        rows = [
            [(m.shape, 2.0 * math.pi * m.natural_frequency_hz, m.damping_ratio, m.modal_mass) for m in self.modes(s)]
            for s in positions.tolist()
        ]
        return np.array(rows)

    def _mode(self, bar: _BarModes, k: int, tool_position: float) -> Mode:
        omega, mass = float(bar.omega[k]), float(bar.mass[k])
        chuck_loss = self.chuck.tilt_damping * float(bar.slope[-1, k]) ** 2 / (2.0 * mass * omega)
        return Mode(
            natural_frequency_hz=omega / (2.0 * math.pi),
            modal_mass=mass,
            damping_ratio=self.damping_ratios[k] + chuck_loss,
            shape=_hermite(bar.distance, bar.shape[:, k], bar.slope[:, k], tool_position),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _BarModes:
    distance: np.ndarray
    omega: np.ndarray
    mass: np.ndarray
    shape: np.ndarray
    slope: np.ndarray


@lru_cache(maxsize=512)
def _bar_modes(bar: Workpiece, tool_position: float) -> _BarModes:
    """Solve the stepped bar; nodes run from the tip to the chuck."""
    steps = [x for x in (bar.turned_length, tool_position) if 1e-6 < x < bar.length - 1e-6]
    nodes = np.unique(np.concatenate([np.linspace(0.0, bar.length, _ELEMENTS + 1), np.array(steps, dtype=float)]))
    nodes = nodes[np.concatenate([[True], np.diff(nodes) > 1e-7])]
    size = 2 * nodes.size
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for i, (left, right) in enumerate(zip(nodes[:-1], nodes[1:], strict=True)):
        diameter = bar.diameter_at(0.5 * (left + right), tool_position)
        part = slice(2 * i, 2 * i + 4)
        k, m = timoshenko_element(bar, diameter, float(right - left))
        stiffness[part, part] += k
        mass[part, part] += m
    stiffness[-2, -2] += bar.chuck.lateral_stiffness
    stiffness[-1, -1] += bar.chuck.tilt_stiffness
    count = len(bar.damping_ratios)
    values, vectors = eigh(stiffness, mass, subset_by_index=[0, count - 1])
    vectors = vectors / vectors[0]
    modal_mass = np.einsum("ik,ij,jk->k", vectors, mass, vectors)
    return _BarModes(
        distance=nodes, omega=np.sqrt(values), mass=modal_mass, shape=vectors[::2].copy(), slope=vectors[1::2].copy()
    )


def timoshenko_element(bar: Workpiece, diameter: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and consistent mass of one element with rotary inertia, shape (4, 4) each.

    Interpolation is exact for end loads (Przemieniecki, Theory of Matrix Structural Analysis, 1968, section 5.6); the
    shear factor is that of Cowper (1966) for a round section.
    """
    area, inertia = math.pi * diameter**2 / 4.0, math.pi * diameter**4 / 64.0
    nu, e = bar.poisson_ratio, bar.young_modulus
    shear = 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu) * area * e / (2.0 * (1.0 + nu))
    p, n = 12.0 * e * inertia / (shear * length**2), length
    k = np.array(
        [
            [12.0, 6.0 * n, -12.0, 6.0 * n],
            [6.0 * n, (4.0 + p) * n * n, -6.0 * n, (2.0 - p) * n * n],
            [-12.0, -6.0 * n, 12.0, -6.0 * n],
            [6.0 * n, (2.0 - p) * n * n, -6.0 * n, (4.0 + p) * n * n],
        ]
    )
    m = np.zeros((4, 4))
    points, weights = np.polynomial.legendre.leggauss(4)
    for x, weight in zip((points + 1.0) / 2.0, weights * n / 2.0, strict=True):
        move = np.array(
            [
                1.0 - 3.0 * x**2 + 2.0 * x**3 + p * (1.0 - x),
                n * (x - 2.0 * x**2 + x**3 + p / 2.0 * (x - x**2)),
                3.0 * x**2 - 2.0 * x**3 + p * x,
                n * (-(x**2) + x**3 - p / 2.0 * (x - x**2)),
            ]
        )
        turn = np.array(
            [
                6.0 / n * (x**2 - x),
                1.0 - 4.0 * x + 3.0 * x**2 + p * (1.0 - x),
                6.0 / n * (x - x**2),
                3.0 * x**2 - 2.0 * x + p * x,
            ]
        )
        m += weight * bar.density * (area * np.outer(move, move) + inertia * np.outer(turn, turn))
    return k * e * inertia / (n**3 * (1.0 + p)), m / (1.0 + p) ** 2


def _hermite(x: np.ndarray, y: np.ndarray, slope: np.ndarray, at: float) -> float:
    i = min(int(np.searchsorted(x, at, side="right")) - 1, x.size - 2)
    n = float(x[i + 1] - x[i])
    t = (at - float(x[i])) / n
    a = (1.0 + 2.0 * t) * (1.0 - t) ** 2 * y[i] + t * (1.0 - t) ** 2 * n * slope[i]
    return float(a + t * t * (3.0 - 2.0 * t) * y[i + 1] + t * t * (t - 1.0) * n * slope[i + 1])
