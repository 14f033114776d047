"""The guard against everything at once: any requests, commands, paths and machine states, in any order."""

import math

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from tests.services.guard_kit import BLOCK, Rig, on_arc, worst

LIVE = ("ACTIVE", "HOLDING", "RETURNING")
WEIRD = st.sampled_from([math.nan, math.inf, -math.inf, 1e9, -50.0, 1e308, 5.0001])
SAMPLES = st.integers(-10_000, 10_000)
REQUESTS = st.sampled_from(["arm", "dry_run", "disarm", "reset", "stop", "jump"])
CONDITIONS = st.fixed_dictionaries(
    {},
    optional={
        "in_cut": st.booleans(),
        "feed_hold": st.booleans(),
        "spindle_hz": st.sampled_from([20.0, 0.0, 61.0, math.nan]),
        "blocked": st.sampled_from(["", "tool change"]),
        "homed": st.sampled_from([True, True, True, False]),
        "diameter": st.sampled_from([0.025, 0.0251, 0.0, math.nan, 1e9]),
    },
)
PATHS = st.sampled_from(["nan", "offset", "noise", "walk", "ramp", "frozen", "short", "accelerate"])


def hostile(kind, points, rng):
    size, n = 10.0 ** rng.uniform(-9, 0), points.shape[1]
    return {
        "nan": lambda: np.where(rng.random(points.shape) < 0.02, np.nan, points),
        "offset": lambda: points + size,
        "noise": lambda: points + rng.normal(size=points.shape) * size,
        "walk": lambda: points + np.cumsum(rng.normal(size=points.shape), axis=1) * size,
        "ramp": lambda: on_arc(points[0] + size * np.linspace(0, 1, n)),
        "frozen": lambda: np.repeat(points[:, :1], n, axis=1),
        "short": lambda: points[:, : n // 2],
        "accelerate": lambda: on_arc(points[0] + size * np.linspace(0, 1, n) ** 3),
    }[kind]()


class GuardMachine(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.rng = np.random.default_rng(1)
        self.rig = Rig(on_loss="return", moves_per_minute=20, freeze_out_of_cut=True)
        self.heard, self.before = [], "OFF"

    @rule(request=REQUESTS)
    def ask(self, request):
        before = self.rig.guard.state
        refused = self.rig.ask(request)
        self.heard.append(f"n{self.rig.nonce}")
        if request == "stop":
            assert not refused
            assert self.rig.guard.state in ("OFF", "FAULT")
        assert self.rig.guard.state in (before, "OFF")
        assert before != "FAULT" or self.rig.guard.state == "FAULT" or request == "reset"

    @precondition(lambda self: self.heard)
    @rule(request=REQUESTS)
    def replay_a_request(self, request):
        before = self.rig.guard.state
        assert self.rig.ask(request, nonce=self.heard[-1]) == "nonce used before"
        assert self.rig.guard.state == before

    @rule(shift_deg=st.floats(-4.9, 4.9), blocks=st.integers(1, 40))
    def cut(self, shift_deg, blocks):
        for _ in range(blocks):
            self.rig.say(shift_deg)
            self.block()

    @rule(blocks=st.integers(1, 60))
    def silence(self, blocks):
        for _ in range(blocks):
            self.block()

    @rule()
    def bring_it_up(self):
        self.rig.conditions = {}
        self.block()
        self.rig.ask("reset")
        self.rig.ask("arm")
        self.block()

    @rule(shift_deg=WEIRD | st.floats(-6, 6), issued=SAMPLES, due=SAMPLES, expires=SAMPLES, sequence=st.integers(-9, 9))
    def forge(self, shift_deg, issued, due, expires, sequence):
        now, known = self.rig.now, self.rig.sequence
        before = self.rig.guard.requested
        verdict = self.rig.say(
            shift_deg,
            issued_sample=now + issued,
            apply_at_sample=now + due,
            expires_at_sample=now + expires,
            sequence=known + sequence,
        )
        self.rig.sequence = max(known, known + sequence)
        if verdict.accepted:
            assert abs(shift_deg) <= 5.0
            assert issued <= 0 <= expires
        else:
            assert self.rig.guard.requested == before

    @rule(wrong=st.sampled_from(["run", "source", "session"]))
    def strange(self, wrong):
        assert not self.rig.say(1.0, **{wrong: "other"}).accepted

    @rule(conditions=CONDITIONS, blocks=st.integers(1, 5))
    def machine_changes(self, conditions, blocks):
        self.rig.conditions = conditions
        for _ in range(blocks):
            self.rig.say(math.degrees(self.rig.guard.requested))
            self.block()

    @rule(kind=PATHS, blocks=st.integers(1, 3))
    def bad_path(self, kind, blocks):
        self.rig.mangle = lambda points: hostile(kind, points, self.rng)
        for _ in range(blocks):
            self.block()
        self.rig.mangle = lambda points: points

    @rule(wrong=st.sampled_from([math.nan, 1e-3, 1e9]))
    def bad_encoder(self, wrong):
        self.rig.measure = lambda issued: issued + wrong
        self.block()
        self.rig.measure = lambda issued: issued

    @rule(jump=st.integers(-1000, 1000))
    def clock_jumps(self, jump):
        self.rig.now = max(self.rig.now + jump, 0)

    def block(self):
        was_off = self.rig.guard.state in ("OFF", "ARMED", "FAULT") and not self.rig.guard.moving
        checked = self.rig.block(BLOCK)
        if was_off and self.rig.guard.state in ("OFF", "ARMED", "FAULT"):
            assert not np.ptp(np.array(checked[:3]), axis=1).any()
        if checked.followed:
            assert self.rig.guard.state in ("ACTIVE", "RETURNING")

    @invariant()
    def states_and_counts_agree(self):
        guard = self.rig.guard
        assert (guard.session != "") is (guard.state in LIVE)
        assert guard.feed_inhibit_requested is (guard.state == "FAULT")
        assert guard.commands_rejected == sum(guard.rejected.values())
        assert abs(guard.requested) <= guard.limits.shift
        if guard.moving and guard.state in ("OFF", "ARMED", "FAULT"):
            assert guard.target == guard.requested

    def teardown(self):
        for _ in range(40):
            self.block()
        self.rig.ask("stop")
        for _ in range(40):
            self.block()
        assert not self.rig.guard.moving
        assert worst(self.rig.points(), self.rig.limits) <= 1.0


GuardMachine.TestCase.settings = settings(max_examples=50, stateful_step_count=25)
TestGuardMachine = GuardMachine.TestCase


@pytest.mark.parametrize("seed", range(8))
def test_random_days(seed):
    """Sound and hostile traffic at random, 40 s each; every set point that leaves is within every limit."""
    rng = np.random.default_rng(seed)
    rig = Rig(on_loss=("hold", "return")[seed % 2], moves_per_minute=60, samples=(90, 37, 270, 1)[seed // 2])
    target, followed, said = 0.0, 0, 0
    for _ in range(4000):
        dice = rng.random()
        if dice < 0.02:
            rig.conditions = {}
            for request in ("reset", "arm"):
                rig.ask(request)
        elif dice < 0.03:
            rig.ask(("stop", "disarm", "dry_run", "reset")[rng.integers(4)])
        elif dice < 0.05:
            target = float(rng.uniform(-5.2, 5.2))
        elif dice < 0.052:
            rig.conditions = ({"feed_hold": True}, {"homed": False}, {"spindle_hz": 1.0})[rng.integers(3)]
        elif dice < 0.06:
            kind = ("nan", "offset", "noise", "walk", "ramp", "frozen", "short", "accelerate")[rng.integers(8)]
            rig.mangle = lambda points, kind=kind: hostile(kind, points, rng)
        if dice < 0.95:
            said += rig.say(target).accepted
        for _ in range(rng.poisson(0.3)):
            rig.say(
                float(rng.normal() * 10.0 ** rng.integers(-3, 9)), sequence=int(rng.integers(0, 2 * rig.sequence + 2))
            )
        followed += rig.block().followed
        rig.mangle = lambda points: points
    assert said > 100
    assert followed > 100
    rig.assert_within()
