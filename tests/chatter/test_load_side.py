"""The load-side observer on an independent two-axis stage: gain, cross mass, delays, counts, any cutting."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter import LoadSideObserver, NominalFeedDrive, NominalTurret
from chatter.observers.delays import align, lagrange
from tests.reference.two_axis_stage import TwoAxisStage

RATE = 9000.0
X1 = NominalFeedDrive(
    lead=8e-3, rotor_inertia=4e-3, rotor_damping=3e-2, stage_mass=250.0, stage_damping=4e3, screw_stiffness=1.5e8,
    screw_damping=2e4, motor_resolution=66.7e-9, stage_resolution=1e-9, motor_delay=1 / RATE, stage_delay=1 / RATE,
    thrust_delay=1 / RATE, omega_current=3000.0,
)  # fmt: skip
Y1 = replace(
    X1,
    lead=6e-3,
    rotor_inertia=3e-3,
    rotor_damping=2e-2,
    stage_mass=150.0,
    stage_damping=1.2e4,
    motor_resolution=37.5e-9,
)
NTY3 = NominalTurret(x1=X1, y1=Y1, upper_mass=150.0)
FINE = replace(
    NTY3,
    x1=replace(X1, motor_resolution=0.0, stage_resolution=0.0),
    y1=replace(Y1, motor_resolution=0.0, stage_resolution=0.0),
)


def truth(turret):
    names = {
        "lead": "lead", "J": "rotor_inertia", "D": "rotor_damping", "M": "stage_mass", "Ct": "stage_damping",
        "K": "screw_stiffness", "Ck": "screw_damping",
    }  # fmt: skip
    return [{key: getattr(drive, name) for key, name in names.items()} for drive in turret.drives]


def signals(turret, force, frequency_hz=612.0, samples=3000):
    """Motor and stage positions under F sin(omega t), and that force."""
    stage = TwoAxisStage(truth(turret), turret.upper_mass * np.sqrt(0.5), turret.axis_angle, force, frequency_hz)
    x1, y1 = turret.drives
    ages = np.array([x1.motor_delay, y1.motor_delay, x1.stage_delay, y1.stage_delay]) * RATE
    out = stage.run(samples, RATE, ages)
    for column, q in enumerate([x1.motor_resolution, y1.motor_resolution, x1.stage_resolution, y1.stage_resolution]):
        if q > 0.0:
            out[:, column] = np.floor(out[:, column] / q + 0.5) * q
    return out[:, :2], out[:, 2:]


def phasor(series, frequency_hz=612.0, skip=500):
    """Complex amplitude against sin(omega t), t = 0 at a whole second of the simulation."""
    angle = 2 * np.pi * frequency_hz * np.arange(skip, len(series)) / RATE
    basis = np.column_stack([np.ones_like(angle), np.sin(angle), np.cos(angle)])
    fit = np.linalg.lstsq(basis, series[skip:], rcond=None)[0]
    return fit[1] + 1j * fit[2]


def gain(turret, force, nominal=None, frequency_hz=612.0):
    observer = LoadSideObserver(nominal or turret, RATE)
    return phasor(observer.update(*signals(turret, force, frequency_hz)), frequency_hz), observer


@pytest.mark.parametrize("force", [(1.0, 0.0), (0.0, 1.0), (1.0, -0.7)])
@pytest.mark.parametrize("frequency_hz", [500.0, 612.0, 750.0])
def test_unit_force_comes_back_in_size_phase_and_direction(force, frequency_hz):
    got, observer = gain(FINE, force, frequency_hz=frequency_hz)
    np.testing.assert_allclose(got / observer.response(frequency_hz), force, rtol=0, atol=0.012)
    np.testing.assert_allclose(np.abs(observer.response(frequency_hz)), 1.0, atol=0.07)


@pytest.mark.parametrize("force", [(1.0, 0.0), (0.0, 1.0)])
def test_gain_at_612_hz_is_within_three_percent_low_pass_and_all(force):
    got, _ = gain(FINE, force)
    np.testing.assert_allclose(np.abs(got), force, rtol=0, atol=0.03)


def test_without_the_cross_mass_the_force_is_wrong_as_published():
    blind = replace(FINE, upper_mass=0.0)
    along_x = np.abs(gain(FINE, (1.0, 0.0), blind)[0])
    along_y = np.abs(gain(FINE, (0.0, 1.0), blind)[0])
    assert abs(along_x[1]) > 0.2 or abs(along_x[0] - 1.0) > 0.2
    assert 0.45 < along_y[0] < 0.82
    assert 1.9 < along_y[1] < 2.3


def test_counts_of_the_real_encoders_leave_a_hundred_newton_intact():
    got, observer = gain(NTY3, (100.0, 50.0))
    np.testing.assert_allclose(got / observer.response(612.0), [100.0, 50.0], rtol=0, atol=2.0)


def test_ten_percent_of_stiffness_hardly_matters_in_the_band():
    nominal = replace(FINE, x1=replace(FINE.x1, screw_stiffness=1.65e8), y1=replace(FINE.y1, screw_stiffness=1.65e8))
    got, observer = gain(FINE, (1.0, 0.0), nominal)
    np.testing.assert_allclose(np.abs(got / observer.response(612.0)), [1.0, 0.0], rtol=0, atol=0.03)


@given(ages=st.lists(st.floats(0.0, 4.0), min_size=4, max_size=4))
def test_signals_of_different_age_are_aligned(ages):
    late = replace(
        FINE,
        x1=replace(FINE.x1, motor_delay=ages[0] / RATE, stage_delay=ages[2] / RATE),
        y1=replace(FINE.y1, motor_delay=ages[1] / RATE, stage_delay=ages[3] / RATE),
    )
    positions = np.random.default_rng(0).standard_normal(4)
    observer = LoadSideObserver(late, RATE)
    n = np.arange(300)
    moved = [p * 1e-6 * np.sin(2 * np.pi * 400.0 * (n - a) / RATE) for p, a in zip(positions, ages, strict=True)]
    aligned = LoadSideObserver(FINE, RATE)
    common = align(ages).age
    ideal = [p * 1e-6 * np.sin(2 * np.pi * 400.0 * (n - common) / RATE) for p in positions]
    got = observer.update(np.stack(moved[:2], 1), np.stack(moved[2:], 1))
    wanted = aligned.update(np.stack(ideal[:2], 1), np.stack(ideal[2:], 1))
    late_by, ideal_by = phasor(got, 400.0, 150), phasor(wanted, 400.0, 150)
    np.testing.assert_allclose(late_by, ideal_by, rtol=0, atol=2e-3 * np.abs(ideal_by).max())


@given(cuts=st.lists(st.integers(0, 100), min_size=1, max_size=8), fraction=st.booleans())
def test_any_blocks_give_the_same_force(cuts, fraction):
    turret = replace(NTY3, y1=replace(Y1, stage_delay=1.37 / RATE)) if fraction else NTY3
    rng = np.random.default_rng(0)
    motor, stage = (np.cumsum(1e-6 * rng.standard_normal((sum(cuts), 2)), axis=0) + 0.2 for _ in range(2))
    whole = LoadSideObserver(turret, RATE).update(motor, stage)
    observer, edges = LoadSideObserver(turret, RATE), [0, *np.cumsum(cuts)]
    pieces = [observer.update(motor[a:b], stage[a:b]) for a, b in zip(edges, edges[1:], strict=False)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_constant_load_gives_no_force_and_no_transient():
    observer = LoadSideObserver(NTY3, RATE)
    still = np.full((500, 2), [0.12345678, -0.2])
    np.testing.assert_array_equal(observer.update(still + 3e-6, still), 0.0)


def test_moving_axis_starts_without_a_blow():
    observer = LoadSideObserver(FINE, RATE)
    travel = (0.003 * np.arange(300) / RATE)[:, None] * np.ones(2)
    force = observer.update(travel, travel)
    assert np.abs(force).max() < 1.5 * np.hypot(4e3, 1.2e4) * 0.003 * np.sqrt(2)
    assert observer.first_valid_sample == 2


def test_idling_force_is_taken_off():
    motor, stage = signals(NTY3, (100.0, 50.0), samples=200)
    plain, idle = LoadSideObserver(NTY3, RATE), LoadSideObserver(NTY3, RATE)
    idle.set_idling([3.0, -4.0])
    np.testing.assert_allclose(plain.update(motor, stage) - idle.update(motor, stage), np.full((200, 2), [3.0, -4.0]))
    with pytest.raises(ValueError, match="force must be two finite values"):
        idle.set_idling([1.0, np.nan])


def test_latency_is_age_plus_kernel_plus_low_pass():
    observer = LoadSideObserver(NTY3, RATE)
    assert observer.latency == pytest.approx(2 / RATE + 0.3988e-3, rel=1e-3)
    slope = np.angle(observer.response(1.0)) / (2 * np.pi)
    assert -slope == pytest.approx(observer.latency, rel=1e-3)


def test_state_can_be_copied_and_put_back():
    motor, stage = signals(NTY3, (100.0, 50.0), samples=300)
    a, b = LoadSideObserver(NTY3, RATE), LoadSideObserver(NTY3, RATE)
    a.update(motor[:100], stage[:100])
    state = a.snapshot()
    wanted = a.update(motor[100:], stage[100:])
    b.restore(state)
    np.testing.assert_array_equal(b.update(motor[100:], stage[100:]), wanted)
    a.reset()
    np.testing.assert_array_equal(a.update(motor, stage), LoadSideObserver(NTY3, RATE).update(motor, stage))
    with pytest.raises(ValueError, match="state"):
        LoadSideObserver(NTY3, RATE, order=2).restore(state)


def test_a_sample_that_is_not_finite_is_named_and_harms_nothing():
    motor, stage = signals(NTY3, (100.0, 50.0), samples=200)
    a, b = LoadSideObserver(NTY3, RATE), LoadSideObserver(NTY3, RATE)
    for observer in (a, b):
        observer.update(motor[:50], stage[:50])
    broken = stage[50:].copy()
    broken[7, 1] = np.nan
    with pytest.raises(ValueError, match="sample 57 of the stream.*channel 3"):
        a.update(motor[50:], broken)
    np.testing.assert_array_equal(a.update(motor[50:], stage[50:]), b.update(motor[50:], stage[50:]))
    with pytest.raises(ValueError, match="stage_position must be of the shape"):
        a.update(motor, stage[:-1])


def test_lagrange_fraction_is_exact_for_cubics():
    for d in (0.0, 0.3, 0.9):
        t = -np.arange(4.0)
        for power in range(4):
            assert lagrange(d) @ t**power == pytest.approx((-1.0 - d) ** power, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lead": 0.0}, "lead must be positive and finite, got 0.0"),
        ({"stage_damping": -1.0}, "stage_damping must be at least 0 and finite"),
        ({"screw_stiffness": np.nan}, "screw_stiffness must be positive and finite"),
    ],
)
def test_wrong_parameters_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(X1, **change)


def test_wrong_turret_is_refused():
    with pytest.raises(ValueError, match="upper_mass must be at least 0"):
        replace(NTY3, upper_mass=-1.0)
    with pytest.raises(ValueError, match="axis_angle must be in"):
        replace(NTY3, axis_angle=0.0)


def test_modal_numbers_of_the_sheet():
    assert X1.mass_ratio == pytest.approx(250.0 * (8e-3 / (2 * np.pi)) ** 2 / 4e-3)
    np.testing.assert_allclose(NTY3.force_from_loads(), [[1.0, 0.0], [1.0, -np.sqrt(2.0)]], atol=1e-15)
