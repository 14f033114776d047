"""The expanded Kalman filter beside its definition, with and without the lines of tooth passing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag, expm
from scipy.signal import cont2discrete

from chatter.observers.kalman import (
    HARMONICS,
    ForceModel,
    KalmanObserver,
    alias_hz,
    force_from_motor_torque,
    van_loan,
)

RATE = 250.0


def mode(hz, damping, gain):
    """Return a mode with a static gain in modal form."""
    w = 2 * np.pi * hz
    return np.array([[0.0, 1.0], [-w * w, -2 * damping * w]]), np.array([0.0, gain * w * w]), np.array([1.0, 0.0])


def two_modes(rate_scale=1.0):
    """Modes at 32 and 88 Hz."""
    parts = [mode(32.0 * rate_scale, 0.12, 0.7), mode(88.0 * rate_scale, 0.08, 0.3)]
    return ForceModel(
        a=block_diag(*(p[0] for p in parts)),
        b=np.concatenate([p[1] for p in parts]),
        c=np.concatenate([p[2] for p in parts]),
    )


def measured(model, force, substeps=20):
    """Thrust at every `substeps`-th of the fine samples of a held force."""
    a, b, c, _, _ = cont2discrete(
        (model.a, model.b[:, None], model.c[None, :], [[model.d]]), 1.0 / (RATE * substeps), method="zoh"
    )
    x, out = np.zeros(len(model.a)), np.empty(len(force))
    for k, f in enumerate(force):
        out[k] = float(c[0] @ x + model.d * f)
        x = a @ x + b[:, 0] * f
    return out[::substeps]


def cut(tooth_hz=55.0, seconds=6.0, seed=0, noise=1.0, substeps=20):
    time = np.arange(round(seconds * RATE * substeps)) / (RATE * substeps)
    on = time > 0.5
    force = on * (100.0 + 60.0 * np.sin(2 * np.pi * tooth_hz * time) + 20.0 * np.sin(4 * np.pi * tooth_hz * time + 1.0))
    y = measured(two_modes(), force, substeps)
    return y + noise * np.random.default_rng(seed).standard_normal(len(y)), force[::substeps]


def error(observer, y, force, skip=500):
    got = observer.update(None, None, y)
    return float(np.std(got[skip:] - force[skip:]) / np.std(force[skip:]))


def test_knowing_the_teeth_is_worth_a_factor_of_three():
    y, force = cut()
    lines = [h * 55.0 for h in HARMONICS]
    known = error(KalmanObserver(two_modes(), RATE, lines_hz=lines), y, force)
    blind = min(error(KalmanObserver(two_modes(), RATE, drift=d), y, force) for d in np.geomspace(10.0, 1e5, 13))
    assert known < 0.17
    assert blind > 0.45
    assert known < blind / 3.0


def test_the_filter_is_the_textbook_recursion():
    y, _ = cut(seconds=1.0)
    lines = (27.5, 55.0)
    observer = KalmanObserver(two_modes(), RATE, lines_hz=lines, drift=300.0, line_drift=150.0, noise=2.0)
    model, dt = two_modes(), 1.0 / RATE
    m = len(model.a)
    a = np.zeros((m + 5, m + 5))
    a[:m, :m], a[:m, m], a[:m, m + 1], a[:m, m + 3] = model.a, model.b, model.b, model.b
    for k, hz in enumerate(lines):
        w = 2 * np.pi * hz
        a[m + 1 + 2 * k, m + 2 + 2 * k], a[m + 2 + 2 * k, m + 1 + 2 * k] = -w, w
    q = np.diag([0.0] * m + [300.0**2, 150.0**2, 0.0, 150.0**2, 0.0])
    fine = 400  # noise integrated over small steps instead of Van Loan's exponential
    small, qd = expm(a * dt / fine), np.zeros_like(a)
    for _ in range(fine):
        qd = small @ (qd + 0.5 * q * dt / fine) @ small.T + 0.5 * q * dt / fine
    ad, c = expm(a * dt), np.concatenate([model.c, np.zeros(5)])
    p, x, force = np.eye(m + 5) * 1e3, np.zeros(m + 5), np.concatenate([np.zeros(m), [1, 1, 0, 1, 0]])
    for _ in range(4000):  # to the steady state
        gain = p @ c / (c @ p @ c + 4.0)
        p = ad @ (p - np.outer(gain, c) @ p) @ ad.T + qd
    out = []
    for sample in y:
        x = x + gain * (sample - c @ x)
        out.append(force @ x)
        x = ad @ x
    np.testing.assert_allclose(observer.update(None, None, y), out, rtol=0, atol=2e-3 * np.abs(out).max())


def test_what_it_believes_of_its_error_is_what_it_makes():
    rng = np.random.default_rng(1)
    observer = KalmanObserver(two_modes(), RATE, lines_hz=(55.0,), drift=300.0, line_drift=200.0, noise=2.0)
    root = np.linalg.cholesky(observer._added + 1e-12 * np.trace(observer._added) * np.eye(len(observer._c)))
    x, y, truth = np.zeros(len(observer._c)), [], []
    for _ in range(6000):
        y.append(observer._c @ x + 2.0 * rng.standard_normal())
        truth.append(observer._force @ x)
        x = observer._transition @ x + root @ rng.standard_normal(len(x))
    made = np.std(observer.update(None, None, np.array(y))[300:] - np.array(truth)[300:])
    assert made == pytest.approx(observer.force_std, rel=0.08)


@given(cuts=st.lists(st.integers(0, 90), min_size=1, max_size=6))
def test_any_blocks_give_the_same_force(cuts):
    y = np.random.default_rng(0).standard_normal(sum(cuts))
    whole = KalmanObserver(two_modes(), RATE, lines_hz=(55.0,)).update(None, None, y)
    observer, edges = KalmanObserver(two_modes(), RATE, lines_hz=(55.0,)), [0, *np.cumsum(cuts)]
    pieces = [observer.update(None, None, y[a:b]) for a, b in zip(edges, edges[1:], strict=False)]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


def test_lost_samples_are_predicted_over():
    y, force = cut()
    y[700:720] = np.nan
    y[1000:1400:3] = np.nan
    observer = KalmanObserver(two_modes(), RATE, lines_hz=[h * 55.0 for h in HARMONICS])
    assert error(observer, y, force) < 0.25
    with pytest.raises(ValueError, match="thrust must be finite or NaN"):
        observer.update(None, None, [np.inf])


def test_even_intervals_are_the_steady_filter():
    y, _ = cut(seconds=1.0)
    even = KalmanObserver(two_modes(), RATE, lines_hz=(55.0,))
    timed = KalmanObserver(two_modes(), RATE, lines_hz=(55.0,))
    expected = even.update(None, None, y)
    got = timed.update_at(y, np.full(len(y), 1.0 / RATE))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_jitter_that_is_known_does_no_harm():
    substeps = 20
    rng = np.random.default_rng(2)
    time = np.arange(round(4.0 * RATE * substeps)) / (RATE * substeps)
    force = 100.0 + 60.0 * np.sin(2 * np.pi * 55.0 * time)
    fine = np.repeat(np.nan, len(force))
    model = two_modes()
    step = expm(np.block([[model.a, model.b[:, None]], [np.zeros((1, 5))]]) / (RATE * substeps))
    x = np.zeros(4)
    for k, f in enumerate(force):
        fine[k] = model.c @ x
        x = step[:4, :4] @ x + step[:4, 4] * f
    index = np.arange(0, len(force) - substeps, substeps) + rng.integers(0, 12, len(force) // substeps - 1)
    steps = np.diff(index, prepend=index[0] - substeps) / (RATE * substeps)
    timed = KalmanObserver(model, RATE, lines_hz=(55.0,), noise=0.5)
    got = timed.update_at(fine[index], steps)
    blind = KalmanObserver(model, RATE, lines_hz=(55.0,), noise=0.5).update(None, None, fine[index])
    known, unknown = (np.std((g - force[index])[400:]) / np.std(force) for g in (got, blind))
    assert known < 0.15
    assert known < 0.5 * unknown


def test_lines_above_half_the_rate_count_at_their_alias():
    assert alias_hz(110.0, RATE) == 110.0
    assert alias_hz(160.0, RATE) == pytest.approx(90.0)
    assert alias_hz(260.0, RATE) == pytest.approx(10.0)
    observer = KalmanObserver(two_modes(), RATE, lines_hz=(160.0,))
    assert observer.lines_hz == (90.0,)
    with pytest.raises(ValueError, match="lines_hz must differ and be above 0 after sampling"):
        KalmanObserver(two_modes(), RATE, lines_hz=(90.0, 160.0))
    with pytest.raises(ValueError, match="lines_hz must differ"):
        KalmanObserver(two_modes(), RATE, lines_hz=(250.0,))


def test_a_line_turns_without_loss():
    turn, _ = van_loan(100.0 * np.array([[0.0, -1.0], [1.0, 0.0]]), np.zeros((2, 2)), 0.01)
    np.testing.assert_allclose(turn, [[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]], atol=1e-14)


def test_response_is_that_of_the_modes():
    np.testing.assert_allclose(two_modes().response([1e-6]), [1.0], atol=1e-9)


def test_state_can_be_copied_and_put_back():
    y, _ = cut(seconds=1.0)
    a, b = (KalmanObserver(two_modes(), RATE, lines_hz=(55.0,)) for _ in range(2))
    a.update(None, None, y[:100])
    b.prepare()
    b.restore(a.snapshot())
    np.testing.assert_array_equal(a.update(None, None, y[100:]), b.update(None, None, y[100:]))


def test_models_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="a must be stable"):
        ForceModel(a=np.array([[0.1]]), b=np.ones(1), c=np.ones(1))
    with pytest.raises(ValueError, match="a, b, c must be of shapes"):
        ForceModel(a=np.array([[-0.1]]), b=np.ones(2), c=np.ones(1))
    with pytest.raises(ValueError, match="noise must be positive"):
        KalmanObserver(two_modes(), RATE, noise=0.0)
    with pytest.raises(ValueError, match="thrust must be given"):
        KalmanObserver(two_modes(), RATE).update(None, None)


def test_torque_of_the_motor_becomes_force_of_the_stage():
    np.testing.assert_allclose(force_from_motor_torque([1.0], 0.01, 0.9), [0.9 * 2 * np.pi / 0.01])
    with pytest.raises(ValueError, match="lead must be positive"):
        force_from_motor_torque([1.0], 0.0)
