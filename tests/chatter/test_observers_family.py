"""The estimators that weigh two balances, on a plain stage: exact parameters, wrong ones, dead times, any cutting."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chatter import BiquadFilter
from chatter.observers.family import linear_observer, two_encoder
from chatter.observers.nominal import NominalFeedDrive, NominalTurret, SingleAxis
from tests.reference.one_axis_stage import SUBSTEPS, run

RATE = 20_000.0
A = NominalFeedDrive(
    lead=5e-3, rotor_inertia=3.8e-5, rotor_damping=2.3e-3, stage_mass=6.2, stage_damping=370.0, screw_stiffness=25.7e6,
    screw_damping=2500.0, motor_resolution=0.0, stage_resolution=0.0, motor_delay=0.45e-3, stage_delay=0.1e-3,
    thrust_delay=0.35e-3, omega_current=3000.0,
)  # fmt: skip
NAMES = ("medob", "vibration", "load_side", "blended")


def truth(drive):
    return {
        "Mr": drive.rotor_mass, "Cr": drive.rotor_viscosity, "Mt": drive.stage_mass, "Ct": drive.stage_damping,
        "K": drive.screw_stiffness, "Ck": drive.screw_damping, "omega": drive.omega_current,
    }  # fmt: skip


def signals(drive, samples=4000, lines=((37.0, 80.0), (205.0, 50.0), (335.0, 40.0)), seed=1):
    """Thrust, motor and stage positions under a force of several lines, with that force at the samples."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / RATE
    fine = (np.arange(samples * SUBSTEPS) + 0.5) / (RATE * SUBSTEPS)
    phase = rng.uniform(0, 2 * np.pi, len(lines))

    def force(t):
        return sum(f * np.sin(2 * np.pi * hz * t + p) for (hz, f), p in zip(lines, phase, strict=True))

    thrust = 60.0 * np.sin(2 * np.pi * 23.0 * time) + 30.0 * np.sin(2 * np.pi * 180.0 * time)
    ages = [round(d * RATE * SUBSTEPS) for d in (drive.thrust_delay, drive.motor_delay, drive.stage_delay)]
    motor, stage = run(truth(drive), thrust, force(fine), RATE, ages)
    return thrust, motor, stage, force(time)


def error_ratio(observer, drive, skip=1000):
    """std(error)/std(reference): both through the same low-pass, the estimate earlier by its age."""
    thrust, motor, stage, force = signals(drive)
    got = observer.update(motor, stage, thrust)
    lag = round((observer._alignment.age + 1.0) * 1000) / 1000
    shift = round(lag)
    assert lag == pytest.approx(shift, abs=1e-6)
    wanted = BiquadFilter(observer.sections).update(force)[:, 0]
    error = got[skip:] - wanted[skip - shift : len(wanted) - shift]
    return float(np.std(error) / np.std(wanted[skip:]))


@pytest.mark.parametrize("name", NAMES)
def test_exact_parameters_give_the_force_at_every_age(name):
    assert error_ratio(linear_observer(name, A, RATE), A) < 0.01


@pytest.mark.parametrize("weight", [1.0, 0.0, -0.3, 0.5])
def test_every_weight_gives_the_same_force_with_exact_parameters(weight):
    assert error_ratio(two_encoder(A, RATE, weight), A) < 0.01


def test_dead_times_left_out_cost_ten_times_as_much():
    full = error_ratio(linear_observer("medob", A, RATE), A)
    without = error_ratio(linear_observer("medob", A, RATE, compensation="none"), A)
    assert without > 10.0 * full


def test_a_rigid_drive_and_the_thrust_alone_are_wrong_near_resonance():
    assert error_ratio(linear_observer("dob", A, RATE), A) > 0.5
    assert error_ratio(linear_observer("thrust", A, RATE), A) > 0.5


@pytest.mark.parametrize("name", [*NAMES, "dob", "standing"])
def test_weights_of_the_signals_are_those_of_the_stream(name):
    observer = linear_observer(name, A, RATE, blend_hz=30.0)
    time = np.arange(6000) / RATE
    hz, half = 125.0, 80  # half a period in samples: the difference leaves out what the first sample fixed
    wave = np.exp(2j * np.pi * hz * time)
    for signal in range(3):
        columns = [np.zeros(6000, complex)] * 3
        columns[signal] = wave * 1e-6
        parts = []
        for part in (np.real, np.imag):
            observer.reset()
            parts.append(observer.update(*(part(c) for c in columns)))
        got = (parts[0] + 1j * parts[1])[[5500, 5500 - half]] @ [0.5, -0.5] / (wave[5500] * 1e-6)
        expected = observer.weights([hz])[0, 0, signal]
        assert abs(got - expected) <= 1e-6 * max(abs(expected), 1.0)


def test_mass_error_acts_as_published():
    half = replace(A, stage_mass=3.1)
    predicted = (
        linear_observer("medob", half, RATE).weights([335.0])[0, 0]
        - linear_observer("medob", A, RATE).weights([335.0])[0, 0]
    )
    assert abs(predicted[2]) < 1e-9
    assert abs(predicted[1]) == pytest.approx(3.1 * (2 * np.pi * 335.0) ** 2, rel=1e-3)


@given(
    cuts=st.lists(st.integers(0, 90), min_size=1, max_size=6),
    name=st.sampled_from([*NAMES, "dob", "thrust", "standing"]),
)
def test_any_blocks_give_the_same_force(cuts, name):
    rng = np.random.default_rng(0)
    n = sum(cuts)
    motor, stage = (np.cumsum(1e-7 * rng.standard_normal(n)) + 0.2 for _ in range(2))
    thrust = 100.0 * rng.standard_normal(n)
    drive = replace(A, motor_resolution=38.15e-9, stage_resolution=20e-9, motor_delay=0.4321e-3)
    whole = linear_observer(name, drive, RATE).update(motor, stage, thrust)
    observer, edges = linear_observer(name, drive, RATE), [0, *np.cumsum(cuts)]
    pieces = [observer.update(motor[a:b], stage[a:b], thrust[a:b]) for a, b in zip(edges, edges[1:], strict=False)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_a_turret_takes_every_member_of_the_family():
    turret = NominalTurret(x1=A, y1=replace(A, stage_mass=4.0), upper_mass=2.0)
    rng = np.random.default_rng(0)
    motor, stage = (np.cumsum(1e-8 * rng.standard_normal((200, 2)), axis=0) for _ in range(2))
    thrust = rng.standard_normal((200, 2))
    for name in (*NAMES, "dob", "thrust"):
        force = linear_observer(name, turret, RATE).update(motor, stage, thrust)
        assert force.shape == (200, 2)
        assert np.isfinite(force).all()
    free = replace(turret, upper_mass=0.0, axis_angle=np.pi / 2)
    both = linear_observer("medob", free, RATE).update(motor, stage, thrust)
    alone = linear_observer("medob", SingleAxis(drive=A), RATE).update(motor[:, 0], stage[:, 0], thrust[:, 0])
    np.testing.assert_array_equal(both[:, 0], alone)


def test_state_can_be_copied_and_put_back():
    thrust, motor, stage, _ = signals(A, samples=300)
    for name in (*NAMES, "dob", "standing"):
        a, b = linear_observer(name, A, RATE), linear_observer(name, A, RATE)
        a.update(motor[:100], stage[:100], thrust[:100])
        state = a.snapshot()
        b.prepare()
        b.restore(state)
        rest = (motor[100:], stage[100:], thrust[100:])
        np.testing.assert_array_equal(a.update(*rest), b.update(*rest))


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="name must be one of"):
        linear_observer("kalmann", A, RATE)
    with pytest.raises(ValueError, match="thrust must be given for the estimator medob"):
        linear_observer("medob", A, RATE).update(np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="thrust must be of the shape"):
        linear_observer("medob", A, RATE).update(np.zeros(3), np.zeros(3), np.zeros(4))
    with pytest.raises(ValueError, match="weight must be finite"):
        two_encoder(A, RATE, np.nan)
    with pytest.raises(ValueError, match="compensation must be"):
        linear_observer("medob", A, RATE, compensation="some")
    with pytest.raises(ValueError, match="sample 1 of the stream.*channel 2"):
        linear_observer("medob", A, RATE).update(np.zeros(3), np.zeros(3), np.array([0.0, np.nan, 0.0]))
