"""The limits of the guard: each must be given, make sense and be printed."""

import dataclasses
import math

import pytest

from services.guard_limits import GuardLimits
from tests.services.guard_kit import LIMITS, limits

FIELDS = {field.name: field for field in dataclasses.fields(GuardLimits)}


@pytest.mark.parametrize("name", FIELDS)
def test_no_limit_has_a_default(name):
    values = {key: getattr(LIMITS, key) for key in FIELDS if key != name}
    with pytest.raises(TypeError, match=name):
        GuardLimits(**values)


@pytest.mark.parametrize("value", [0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize("name", [name for name, field in FIELDS.items() if field.metadata["unit"]])
def test_each_number_is_positive_and_finite(name, value):
    if name == "dwell" and value == 0:
        assert limits(dwell=0).dwell == 0
        return
    with pytest.raises(ValueError, match=f"{name} must be positive and finite, got"):
        limits(**{name: value})


@pytest.mark.parametrize(
    ("name", "bad", "good"),
    [
        ("axis_angle", math.pi / 2, 1.57),
        ("shift", math.pi / 4, 0.785),
        ("target", LIMITS.shift, 0.999 * LIMITS.shift),
        ("return_speed", 1.01, 1.0),
        ("interval", 0.5 / 9000.0, 1 / 9000.0),
        ("moves_per_minute", 2.5, 2),
        ("spindle_hz_max", 5.0, 5.1),
        ("loss_return", 0.3, 0.31),
        ("loss_fault", 1.0, 1.01),
        ("on_loss", "guess", "return"),
        ("freeze_out_of_cut", "maybe", True),
        ("dwell", 60.0, 59.0),
    ],
)
def test_rules_between_limits_hold_at_their_edge(name, bad, good):
    assert getattr(limits(**{name: good}), name) == good
    with pytest.raises(ValueError, match=f"{name} must be .*, got {bad}"):
        limits(**{name: bad})


def test_shift_and_slides_have_their_own_limits():
    assert LIMITS.each("speed") == (1.0, 20e-3, 20e-3)
    assert LIMITS.each("path") == (1e-4, 2e-6, 2e-6)


def test_every_limit_is_described_with_its_unit():
    lines = LIMITS.describe()
    assert len(lines) == len(FIELDS)
    assert "dx = 0.00015 m" in lines
    assert "return_speed = 0.25 rad/s (14.3239 deg/s)" in lines
    assert "on_loss = hold" in lines
