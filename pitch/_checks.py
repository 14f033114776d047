"""The rules that arguments of this package obey, with one wording for all of them."""

import math
from operator import index
from typing import Any

import numpy as np
from numpy.typing import NDArray


def finite(name: str, value: Any) -> float:
    """Return `value` as a float, or raise ValueError if it is not a finite number."""
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None
    if not math.isfinite(number):
        raise ValueError(f"{name} must be finite, got {number}")
    return number


def positive(name: str, value: Any) -> float:
    """Return `value` as a float, or raise ValueError if it is not finite and above zero."""
    number = finite(name, value)
    if number <= 0.0:
        raise ValueError(f"{name} must be > 0, got {number}")
    return number


def within(name: str, value: Any, low: float, high: float) -> float:
    """Return `value` as a float, or raise ValueError if it lies outside [low, high]."""
    number = finite(name, value)
    if not low <= number <= high:
        raise ValueError(f"{name} must be in [{low:g}, {high:g}], got {number}")
    return number


def whole(name: str, value: Any, low: int) -> int:
    """Return `value` as an int, or raise ValueError if it is not a whole number of at least `low`."""
    try:
        number = index(value)
    except TypeError:
        number = low - 1
    if number < low:
        raise ValueError(f"{name} must be a whole number >= {low}, got {value!r}")
    return number


def finite_array(name: str, value: Any) -> NDArray[np.float64]:
    """Return `value` as a float64 array, or raise ValueError if anything in it is not a finite number."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers, got {value!r}") from None
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, got {value!r}")
    return array
