"""Three inertias: modes as printed, the force from each mode, and what two inertias leave out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from chatter.observers.family import linear_observer
from chatter.observers.nominal import NominalFeedDrive
from chatter.observers.triple import MODES, triple_observer
from chatter.observers.triple_axis import TripleAxis

RATE, SUBSTEPS = 20_000.0, 10
DRIVE = TripleAxis(
    lead=5e-3, rotor_inertia=2.4e-5, rotor_damping=1.2e-3, nut_mass=22.0, nut_damping=1200.0, stage_mass=6.2,
    stage_damping=370.0, torsion_stiffness=2.2e8, torsion_damping=9000.0, screw_stiffness=3.0e7, screw_damping=2500.0,
    motor_delay=0.15e-3, nut_delay=0.1e-3, stage_delay=0.05e-3, thrust_delay=0.2e-3, omega_current=3000.0,
)  # fmt: skip


def signals(drive=DRIVE, samples=3000):
    """Motor and nut, stage, thrust and force, from the exact step of the seven states."""
    mass, damping, stiffness = drive.matrices()
    a = np.zeros((9, 9))
    a[:3, 3:6] = np.eye(3)
    inverse = np.linalg.inv(mass)
    a[3:6, :3], a[3:6, 3:6] = -inverse @ stiffness, -inverse @ damping
    a[3, 6], a[5, 8] = inverse[0, 0], -inverse[2, 2]
    a[6, 6], a[6, 7] = -drive.omega_current, drive.omega_current
    step = expm(a / (RATE * SUBSTEPS))
    fine = (np.arange(samples * SUBSTEPS) + 0.5) / (RATE * SUBSTEPS)
    time = np.arange(samples) / RATE

    def force(t):
        return 100.0 * np.sin(2 * np.pi * 90.0 * t) + 60.0 * np.sin(2 * np.pi * 366.0 * t + 1.0)

    thrust = 80.0 * np.sin(2 * np.pi * 40.0 * time)
    held, z = np.repeat(thrust, SUBSTEPS), np.zeros(9)
    late = round(drive.thrust_delay * RATE * SUBSTEPS)
    x = np.empty((samples * SUBSTEPS, 3))
    for n in range(samples * SUBSTEPS):
        x[n], z[7], z[8] = z[:3], held[n - late] if n >= late else 0.0, force(fine[n])
        z = step @ z
    ages = [round(d * RATE * SUBSTEPS) for d in (drive.motor_delay, drive.nut_delay, drive.stage_delay)]
    seen = [np.concatenate([np.zeros(a), x[: len(x) - a, k]])[::SUBSTEPS] for k, a in enumerate(ages)]
    return np.stack(seen[:2], axis=1), seen[2], thrust, force(time)


@pytest.mark.parametrize("mode", MODES)
def test_each_mode_gives_the_force_with_exact_parameters(mode):
    motor, stage, thrust, force = signals()
    observer = triple_observer(DRIVE, RATE, mode=mode, cutoff_hz=4000.0)
    got = observer.update(motor, stage, thrust)
    shift = round(observer.latency * RATE)
    error = got[1000:] - np.interp(np.arange(1000, 3000) - observer.latency * RATE, np.arange(3000), force)
    assert shift > 0
    assert np.std(error) < 0.03 * np.std(force)


def test_two_inertias_are_wrong_near_the_first_resonance():
    motor, stage, thrust, force = signals()
    dual = NominalFeedDrive(
        lead=DRIVE.lead, rotor_inertia=DRIVE.rotor_inertia + DRIVE.nut_mass * (DRIVE.lead / (2 * np.pi)) ** 2,
        rotor_damping=DRIVE.rotor_damping + DRIVE.nut_damping * (DRIVE.lead / (2 * np.pi)) ** 2,
        stage_mass=DRIVE.stage_mass, stage_damping=DRIVE.stage_damping, screw_stiffness=DRIVE.screw_stiffness,
        screw_damping=DRIVE.screw_damping, motor_resolution=0.0, stage_resolution=0.0, motor_delay=DRIVE.motor_delay,
        stage_delay=DRIVE.stage_delay, thrust_delay=DRIVE.thrust_delay, omega_current=DRIVE.omega_current,
    )  # fmt: skip
    observer = linear_observer("medob", dual, RATE, cutoff_hz=4000.0)
    got = observer.update(motor[:, 0], stage, thrust)
    error = got[1000:] - np.interp(np.arange(1000, 3000) - observer.latency * RATE, np.arange(3000), force)
    assert np.std(error) > 0.2 * np.std(force)


def test_modes_are_those_of_the_printed_formula():
    frequency, shapes = DRIVE.modes()
    mass, _, stiffness = DRIVE.matrices()
    assert frequency[0] == pytest.approx(0.0, abs=1e-2)
    for k in (1, 2):
        p = -((2 * np.pi * frequency[k]) ** 2)
        nut = 1.0 + DRIVE.rotor_mass / DRIVE.torsion_stiffness * p
        ratio = DRIVE.screw_stiffness / DRIVE.torsion_stiffness * DRIVE.rotor_mass / DRIVE.stage_mass
        stage = (
            ratio * (p + DRIVE.torsion_stiffness / DRIVE.rotor_mass) / (p + DRIVE.screw_stiffness / DRIVE.stage_mass)
        )
        np.testing.assert_allclose(shapes[:, k], [1.0, nut, stage], rtol=1e-6)
    np.testing.assert_allclose(shapes.T @ mass @ shapes - np.diag(np.diag(shapes.T @ mass @ shapes)), 0.0, atol=1e-9)
    np.testing.assert_allclose(shapes[:, 0], 1.0, atol=1e-6)
    assert np.all(np.linalg.eigvalsh(stiffness) > -1e-3)


def test_a_stiff_torsion_leaves_the_vibration_of_two_inertias():
    stiff = replace(DRIVE, torsion_stiffness=1e14)
    both = DRIVE.rotor_mass + DRIVE.nut_mass
    expected = np.sqrt(DRIVE.screw_stiffness * (1 / both + 1 / DRIVE.stage_mass)) / (2 * np.pi)
    assert stiff.modes()[0][1] == pytest.approx(expected, rel=1e-5)


def test_any_blocks_and_a_copied_state_give_the_same():
    motor, stage, thrust, _ = signals(samples=200)
    whole = triple_observer(DRIVE, RATE).update(motor, stage, thrust)
    parts = triple_observer(DRIVE, RATE)
    first = parts.update(motor[:77], stage[:77], thrust[:77])
    other = triple_observer(DRIVE, RATE)
    other.prepare()
    other.restore(parts.snapshot())
    rest = other.update(motor[77:], stage[77:], thrust[77:])
    np.testing.assert_array_equal(np.concatenate([first, rest]), whole)


def test_what_cannot_be_is_refused():
    with pytest.raises(ValueError, match="mode must be one of rigid, first, second"):
        triple_observer(DRIVE, RATE, mode="third")
    with pytest.raises(ValueError, match="nut_mass must be positive"):
        replace(DRIVE, nut_mass=0.0)
