import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from tests.reference.axis import SlowAxis, loop_response
from tests.turning_sim.axes import CONTROL_A, CONTROL_B, held, machine_a, machine_b, pushed, three_inertias
from tests.turning_sim.cases import drives, run, simulator, smooth_step
from turning_sim import AxisDrive, Friction, ServoAxis, SimulationDiverged, Wave, slides_of_shift

SIGNALS = ("thrust", "motor_position", "stage_position", "true_motor_position", "true_stage_position",
           "motor_friction", "stage_friction", "screw_position", "true_screw_position")  # fmt: skip
LUGRE = Friction(coulomb=20.0, static=30.0, stribeck_velocity=2e-3, bristle_stiffness=2e7, bristle_damping=300.0)
DRY = Friction(coulomb=8.0, static=12.0, stribeck_exponent=1.3, viscous=40.0)
ROUGH = {
    "motor_error": (Wave(amplitude=20e-9, wavelength=9.77e-6), Wave(amplitude=5e-9, wavelength=4.88e-6, phase=1.0)),
    "stage_error": (Wave(amplitude=8e-9, wavelength=8e-6, phase=-2.0),),
    "ripple": (Wave(amplitude=3.0, wavelength=83e-6, phase=0.4), Wave(amplitude=5.0, wavelength=5e-3)),
    "load": -3.0,
}
COARSE = {"stage_resolution": 20e-9, "motor_resolution": 38e-9}
BROKEN = {"thrust_delay": 0.1137e-3, "motor_delay": 0.1411e-3, "stage_delay": 0.1713e-3}
ODD = {"thrust_delay": 0.2837e-3, "motor_delay": 0.3911e-3, "stage_delay": 0.0413e-3}


@pytest.mark.parametrize(
    ("drive", "control"),
    [
        (machine_a(**ROUGH), CONTROL_A),
        (machine_a(**ODD, motor_friction=LUGRE), CONTROL_A),
        (machine_a(**COARSE, motor_friction=DRY, stage_friction=LUGRE), CONTROL_A),
        (machine_b(stage_friction=DRY, current_bandwidth=math.inf, thrust_delay=0.0), CONTROL_B),
        (machine_b(motor_friction=DRY, stage_friction=DRY, motor_delay=0.0, stage_delay=0.0), CONTROL_B),
        (machine_b(stage_encoder=False, **ROUGH), CONTROL_B),
        (three_inertias(**ODD, motor_friction=LUGRE, stage_friction=LUGRE), CONTROL_A),
        (three_inertias(motor_friction=DRY, screw_resolution=5e-9, screw_delay=0.0437e-3), None),
    ],
)
def test_kernel_against_the_slow_axis(drive, control):
    """Every part of the model in some mixture, against a plain twin: move, then force, then rest."""
    count, rate, substeps = 160, 10e3, 8
    axis, slow = ServoAxis(drive, control, rate, substeps=substeps), SlowAxis(drive, control, rate, substeps)
    times = axis.force_times(count)
    force = 80.0 * np.sin(2.0 * np.pi * 150.0 * times) + 40.0 * (times > 6e-3)
    command = smooth_step(count, 10, 90, 60e-6) if control else 60.0 * np.sin(np.arange(count) / 12.0)
    fast = axis.advance(command, force)
    for name, expected in zip(SIGNALS, slow.run(command, force), strict=True):
        found = getattr(fast, name)
        no_scale, no_screw = name == "stage_position" and not drive.stage_encoder, drive.screw_inertia is None
        if no_scale or (no_screw and "screw" in name):
            assert np.isnan(found).all()
        else:
            assert found == pytest.approx(expected, rel=1e-8, abs=1e-8 * np.abs(expected).max()), name


def smooth_force(t):
    return 60.0 * np.sin(2.0 * np.pi * 90.0 * t) + 30.0 * np.cos(2.0 * np.pi * 240.0 * t)


def solved(drive, thrust, end, friction=None):
    """Motor and stage at the end by an independent solver: constant thrust, no lags, LuGre at the motor."""
    Mr, Cr, Mt = drive.motor_mass, drive.motor_viscosity, drive.stage_mass
    K, Ck, Ct = drive.drive_stiffness, drive.drive_damping, drive.stage_damping

    def rate(t, y):
        xm, vm, xt, vt, z = y
        spring = K * (xm - xt) + Ck * (vm - vt)
        rub = dz = 0.0
        if friction:
            fall = math.exp(-((vm / friction.stribeck_velocity) ** 2))
            g = friction.coulomb + (friction.static - friction.coulomb) * fall
            dz = vm - friction.bristle_stiffness * abs(vm) / g * z
            rub = friction.bristle_stiffness * z + friction.bristle_damping * dz
        return [vm, (thrust - Cr * vm - spring - rub) / Mr, vt, (spring - Ct * vt - float(smooth_force(t))) / Mt, dz]

    done = solve_ivp(rate, (0.0, end), np.zeros(5), method="DOP853", rtol=1e-11, atol=1e-16, max_step=2e-5)
    return done.y[[0, 2], -1]


def errors_of_substeps(friction, substeps):
    drive, end, count = machine_a(motor_friction=friction).without_lags(), 20e-3, 400
    exact, errors = solved(drive, 50.0, end, friction), []
    for n in substeps:
        axis = ServoAxis(drive, None, 20e3, substeps=n)
        axis.advance(np.full(count, 50.0), smooth_force(axis.force_times(count)))
        errors.append(np.abs(axis._state["z"][[0, 4]] - exact).max() / np.abs(exact).max())
    return np.array(errors)


def test_order_of_the_step_against_an_ode_solver():
    """The mechanics are exact; holding the force over the sub-step costs the second order."""
    errors = errors_of_substeps(None, (10, 20, 40))
    assert errors[0] < 1e-7
    assert errors[:-1] / errors[1:] == pytest.approx(4.0, rel=1e-3)


def test_bristles_against_an_ode_solver():
    """Second order too, as far as the kink of |v| where the motion turns allows."""
    errors = errors_of_substeps(LUGRE, (10, 20, 40))
    assert errors[0] < 2e-7
    assert errors[:-1] / errors[1:] == pytest.approx(4.0, rel=0.1)


def test_dry_friction_against_a_solver_with_events():
    """Stick and slip of the motor under a thrust that comes and goes, switched by events."""
    drive = machine_a(motor_friction=Friction(coulomb=50.0, static=50.0), motor_damping=0.0).without_lags()
    rate, count = 20e3, 2000
    thrust = 90.0 * np.sin(2.0 * np.pi * 10.0 * np.arange(count) / rate)
    out = pushed(drive, thrust, np.zeros_like, rate=rate, substeps=40)
    Mr, Mt, K, Ck, Ct = drive.motor_mass, 6.2, 25.7e6, 2500.0, 370.0
    y, mode, expected = np.zeros(4), 0, np.zeros(count)
    for i in range(count):
        expected[i] = y[0]
        t, end = 0.0, 1.0 / rate

        def push(y, u=thrust[i]):
            return u - K * (y[0] - y[2]) - Ck * (y[1] - y[3])

        while t < end - 1e-15:
            if mode == 0 and abs(push(y)) > 50.0:
                mode = 1 if push(y) > 0.0 else -1

            def slope(_, y, mode=mode, push=push):
                spring = K * (y[0] - y[2]) + Ck * (y[1] - y[3])
                accelerates = 0.0 if mode == 0 else (push(y) - 50.0 * mode) / Mr
                return [y[1], accelerates, y[3], (spring - Ct * y[3]) / Mt]

            def event(s, y, mode=mode, push=push):
                return (abs(push(y)) - 50.0 if mode == 0 else y[1] * mode) if s > 1e-12 else 1e-9 - 2e-9 * (mode == 0)

            event.terminal, event.direction = True, 1.0 if mode == 0 else -1.0
            done = solve_ivp(slope, (0.0, end - t), y, events=event, rtol=1e-10, atol=1e-14)
            t, y = t + done.t[-1], done.y[:, -1]
            if done.status == 1:
                y[1], mode = (0.0, 0) if mode else (y[1], mode)
    assert out.true_motor_position == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


def line(signal, frequency_hz, rate):
    """Complex amplitude of a sinusoid that fits a whole number of times."""
    return 2.0 * np.mean(signal * np.exp(-2j * np.pi * frequency_hz / rate * np.arange(signal.size)))


@pytest.mark.parametrize("frequency_hz", [20.0, 80.0, 170.0, 250.0, 410.0, 900.0, 2600.0])
@pytest.mark.parametrize(
    ("drive", "control"),
    [(machine_b(), CONTROL_B), (machine_b(**BROKEN), CONTROL_B), (machine_a().without_lags(), CONTROL_A)],
)
def test_frequency_response_of_the_sampled_loop(drive, control, frequency_hz):
    """Against the analytic response of the sampled loop, thrust held, aliases folded back."""
    rate, count = 10e3, 10000
    out = held(drive, control, lambda t: 20.0 * np.sin(2.0 * np.pi * frequency_hz * t), rate=rate, seconds=2.0)
    expected = loop_response(drive, control, rate, 10, frequency_hz)
    for name, response in zip(SIGNALS[:3], expected, strict=True):
        found = line(getattr(out, name)[-count:], frequency_hz, rate) / -20j
        assert found == pytest.approx(response, rel=3e-8), name


def test_machine_a_is_lightly_damped_near_176_hz():
    """With its dead times the loop of the thesis rings there; without them it does not."""
    frequencies = np.arange(120.0, 260.0, 1.0)
    gains = [
        np.abs([loop_response(drive, CONTROL_A, 20e3, 10, f, aliases=20)[0] for f in frequencies])
        for drive in (machine_a(), machine_a().without_lags())
    ]
    assert frequencies[np.argmax(gains[0])] == pytest.approx(173.0, abs=5.0)
    assert gains[0].max() > 20.0
    assert gains[1].max() < 2.0


@given(st.lists(st.integers(0, 90), min_size=1, max_size=12), st.integers(0, 3))
@settings(max_examples=25)
def test_any_cut_of_the_stream_gives_the_same(cuts, seed):
    drive = machine_a(motor_friction=LUGRE, stage_friction=DRY, motor_noise=1e-9, stage_noise=1e-9, **ODD)
    count = sum(cuts)
    whole, parts = (ServoAxis(drive, CONTROL_A, 20e3, seed=seed) for _ in range(2))
    force, ref = 50.0 * np.sin(0.01 * np.arange(10 * count)), 1e-7 * np.arange(count)
    expected, at = whole.advance(ref, force), 0
    for n in cuts:
        block = parts.advance(ref[at : at + n], force[10 * at : 10 * (at + n)])
        assert block.first_sample == at
        for name in (*SIGNALS, "true_force"):
            assert np.array_equal(getattr(block, name), getattr(expected, name)[at : at + n], equal_nan=True)
        at += n


def test_snapshot_and_prepare_leave_no_trace():
    axis = ServoAxis(machine_a(motor_friction=LUGRE, motor_noise=1e-9), CONTROL_A, 20e3, seed=5, start_position=0.1)
    axis.prepare()
    force = np.full(1000, 30.0)
    first = axis.advance(np.full(100, 0.1), force)
    kept = axis.snapshot()
    second = axis.advance(np.full(100, 0.1), force)
    axis.restore(kept)
    again = axis.advance(np.full(100, 0.1), force)
    assert np.array_equal(second.thrust, again.thrust)
    fresh = ServoAxis(machine_a(motor_friction=LUGRE, motor_noise=1e-9), CONTROL_A, 20e3, seed=5, start_position=0.1)
    assert np.array_equal(fresh.advance(np.full(100, 0.1), force).thrust, first.thrust)


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 0.44e-3, 0.4417e-3])
def test_dead_times_are_what_they_say(delay):
    """Whole and broken parts of a sub-step: at constant speed a reading is older by v T; a thrust comes T later."""
    drive = machine_a(motor_delay=delay, stage_delay=0.5 * delay, thrust_delay=0.0)
    moving = pushed(drive, np.full(2000, 40.0), np.zeros_like)
    t = np.arange(1500, 2000) / 20e3
    for age, name in ((delay, "motor_position"), (0.5 * delay, "stage_position")):
        true = getattr(moving, f"true_{name}")
        then = np.interp(t - age, np.arange(2000) / 20e3, true)
        assert getattr(moving, name)[1500:] == pytest.approx(then, abs=1e-12 + 1e-7 * true[-1])
    late = pushed(machine_a(thrust_delay=delay), np.full(2000, 40.0), np.zeros_like)
    early = pushed(machine_a(thrust_delay=0.0), np.full(2000, 40.0), np.zeros_like)
    then = np.interp(t - delay, np.arange(2000) / 20e3, early.true_motor_position)
    assert late.true_motor_position[1500:] == pytest.approx(then, abs=1e-12 + 1e-6 * then[-1])


def test_encoders_round_to_the_nearest_count():
    out = pushed(machine_a(**COARSE, motor_delay=0.0, stage_delay=0.0),
                 30.0 * np.sin(np.arange(3000) / 200.0), np.zeros_like)  # fmt: skip
    for name, q in (("motor_position", 38e-9), ("stage_position", 20e-9)):
        read, true = getattr(out, name), getattr(out, f"true_{name}")
        assert read / q == pytest.approx(np.round(read / q), abs=1e-6)
        assert np.abs(read - true).max() <= 0.5000001 * q
        assert np.abs(read - true).std() == pytest.approx(q / math.sqrt(12.0) / 2.0, rel=0.1)


def test_interpolation_errors_repeat_with_position():
    wave = Wave(amplitude=50e-9, wavelength=8e-6, phase=0.3)
    out = held(machine_b(stage_error=(wave,), stage_delay=0.0).without_lags(), CONTROL_B, np.zeros_like, rate=10e3,
               feed=3e-3)  # fmt: skip
    error = out.stage_position - out.true_stage_position
    assert error == pytest.approx(50e-9 * np.sin(2.0 * np.pi * out.true_stage_position / 8e-6 + 0.3), abs=1e-15)


def test_noise_has_its_size_and_its_seed():
    drive = machine_a(motor_noise=2e-9, stage_noise=0.5e-9, motor_delay=0.0, stage_delay=0.0)
    axes = (ServoAxis(drive, None, 20e3, seed=seed) for seed in (1, 1, 2))
    one, same, other = (axis.advance(np.zeros(4000), np.zeros(40000)) for axis in axes)
    assert one.motor_position.std() == pytest.approx(2e-9, rel=0.05)
    assert one.stage_position.std() == pytest.approx(0.5e-9, rel=0.05)
    assert np.array_equal(one.motor_position, same.motor_position)
    assert not np.array_equal(one.motor_position, other.motor_position)


def test_the_loop_follows_and_holds():
    """No error left at rest against a constant force but what position-P leaves; feed costs its friction."""
    out = held(machine_b(), CONTROL_B, lambda t: np.where(t > 0.2, 50.0, 0.0), rate=10e3, seconds=1.5)
    assert out.thrust[-1] == pytest.approx(50.0, rel=1e-6)
    assert abs(out.true_stage_position[-1]) < 1e-9
    assert out.true_motor_position[-1] == pytest.approx(50.0 / 40.5e6, rel=1e-3)
    ramp = held(machine_b(motor_friction=Friction(coulomb=130.0)), CONTROL_B, np.zeros_like, rate=10e3, feed=2e-3)
    viscous = 2e-3 * (machine_b().motor_viscosity + 820.0)
    assert ramp.thrust[-1] == pytest.approx(130.0 + viscous, rel=1e-6)


def test_one_axis_moves_as_that_axis_of_the_turret():
    """The plant of the closed loop, its slides uncoupled: the same drive, law and Dahl friction, another kernel."""
    both = {"stage_resolution": 0.0, "motor_resolution": 0.0, "motor_friction": 300.0, "presliding_stiffness": 2e8}
    turret = dataclasses.replace(drives(**both), upper_mass=0.0)
    sim = simulator(turret=turret, air_time=1e3)
    path = smooth_step(1800, 90, 900, math.radians(2.0))
    expected = run(sim, 0.2, shift=path)
    refs = slides_of_shift(path, sim.diameter, math.pi / 4.0)
    for axis, ref, feed, control in zip(("x1", "y1"), refs, (turret.x1, turret.y1),
                                        (turret.x1_control, turret.y1_control), strict=True):  # fmt: skip
        own = ServoAxis(AxisDrive.of(feed), control, 9000.0, substeps=6).advance(ref, np.zeros(1800 * 6))
        for name in SIGNALS[:3]:
            wanted = expected[f"{axis}_{name}"]
            assert getattr(own, name) == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max()), name


def test_true_force_is_the_mean_about_the_sample():
    axis = ServoAxis(machine_a(), CONTROL_A, 20e3)
    out = axis.advance(np.zeros(50), smooth_force(axis.force_times(50)))
    assert out.true_force[1:] == pytest.approx(smooth_force(np.arange(1, 50) / 20e3), rel=1e-4, abs=1e-3)
    assert out.true_force[0] == pytest.approx(float(smooth_force(2.5e-6)), rel=1e-12)


def test_an_unstable_loop_is_said_to_be_one():
    wild = dataclasses.replace(CONTROL_A, velocity_gain=20000.0)
    axis = ServoAxis(machine_a(), wild, 20e3)
    with pytest.raises(SimulationDiverged, match="its loop is unstable, or nothing holds it"):
        axis.advance(np.full(40000, 1e-3), np.zeros(400000))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"sample_rate_hz": 0.0}, "sample_rate_hz must be finite and positive, got 0.0"),
        ({"substeps": 0}, "substeps must be in 1..1000, got 0"),
        ({"seed": -1}, "seed must be at least 0, got -1"),
        ({"start_position": math.nan}, "start_position must be within 10.0 m, got nan"),
    ],
)
def test_refused_axes(options, said):
    with pytest.raises(ValueError, match=said):
        ServoAxis(machine_a(), CONTROL_A, **({"sample_rate_hz": 20e3} | options))


@pytest.mark.parametrize(
    ("command", "force", "said"),
    [
        (np.zeros((2, 2)), np.zeros(40), r"command must be of shape \(n,\), got \(2, 2\)"),
        (np.zeros(4), np.zeros(4), r"force must be of shape \(40,\), 10 for each command, got \(4,\)"),
        (np.array([0.0, math.nan]), np.zeros(20), r"command must be finite, got \[nan\] at \[1\]"),
        (np.zeros(1), np.array([math.inf] + [0.0] * 9), r"force must be finite, got \[inf\] at \[0\]"),
    ],
)
def test_refused_blocks(command, force, said):
    with pytest.raises(ValueError, match=said):
        ServoAxis(machine_a(), CONTROL_A, 20e3).advance(command, force)
