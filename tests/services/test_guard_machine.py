"""The guard against everything at once: any requests, commands, paths and machine states, in any order."""

import math

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from services.faults.invariants import Ladder
from tests.services.guard_kit import BLOCK, RATE, Rig, on_arc, worst

LIVE = ("ACTIVE", "HOLDING", "RETURNING")
WEIRD = st.sampled_from([math.nan, math.inf, -math.inf, 1e9, -50.0, 1e308, 5.0001])
SAMPLES = st.integers(-10_000, 10_000)
REQUESTS = st.sampled_from(["arm", "dry_run", "disarm", "reset", "stop", "jump"])
CONDITIONS = st.fixed_dictionaries(
    {},
    optional={
        "in_cut": st.booleans(),
        "feed_hold": st.booleans(),
        "spindle_hz": st.sampled_from([20.0, 20.5, 21.0, 0.0, 61.0, math.nan]),
        "blocked": st.sampled_from(["", "tool change"]),
        "homed": st.sampled_from([True, True, True, False]),
        "diameter": st.sampled_from([0.025, 0.0251, 0.0, math.nan, 1e9]),
    },
)
SIGNS_OF_LIFE = ("frozen", "dwell", "moves", "travel")
JOBS = st.fixed_dictionaries({"on_loss": st.sampled_from(["hold", "return"]), "freeze_out_of_cut": st.booleans()})
GARBLED = st.fixed_dictionaries(
    {}, optional={"run": st.text(max_size=4), "source": st.text(max_size=4), "version": st.integers(-9, 9)}
)
FOREIGN = st.sampled_from(
    [{"run": "other"}, {"source": "operator"}, {"source": ""}, {"session": "session-"}, {"version": 2}]
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
    """What must hold is judged from what goes in and comes out: plain differences, times and fields."""

    def __init__(self):
        super().__init__()
        self.rng = np.random.default_rng(1)
        self.heard, self.sessions, self.last = [], {""}, (-1, 0)
        self.before, self.reset, self.quiet = "OFF", False, 0

    @initialize(job=JOBS)
    def the_job(self, job):
        self.rig = Rig(moves_per_minute=20, **job)
        self.ladder = Ladder(self.rig.limits)

    @property
    def guard(self):
        return self.rig.guard

    def request(self, request, **changes):
        before = self.guard.state
        refused = self.rig.ask(request, **changes)
        self.reset |= request == "reset" and not refused
        assert self.guard.state in (before, "OFF")
        assert before != "FAULT" or self.guard.state == "FAULT" or (request == "reset" and not self.guard.moving)
        return refused

    @rule(request=REQUESTS)
    def ask(self, request):
        self.request(request)
        self.heard.append(f"n{self.rig.nonce}")

    @precondition(lambda self: self.heard)
    @rule(request=REQUESTS)
    def replay_a_request(self, request):
        before = self.guard.state
        assert self.rig.ask(request, nonce=self.heard[-1]) == "nonce used before"
        assert self.guard.state == before

    @rule(changes=GARBLED, blocks=st.integers(0, 40))
    def stop_always_works(self, changes, blocks):
        assert self.request("stop", **changes) == ""
        assert self.guard.state in ("OFF", "FAULT")
        for _ in range(blocks):
            self.block()
            assert self.guard.state in ("OFF", "FAULT")

    def say(self, shift_deg, **changes):
        """Put a command; whatever the guard takes must be genuine, new, in time and within limits."""
        cmd, now, lim = self.rig.make(shift_deg, **changes), self.rig.now, self.rig.limits
        before, wanted = self.guard.state, self.guard.requested
        verdict = self.guard.command(cmd, now)
        if verdict.accepted:
            assert abs(cmd.shift_deg) <= math.degrees(lim.target) * (1 + 1e-12)
            assert abs(self.guard.requested - math.radians(cmd.shift_deg)) < 1e-12
        else:
            assert self.guard.requested in (wanted, float(self.guard.position[0])) or self.guard.moving
        if verdict.accepted or verdict.reason in SIGNS_OF_LIFE:
            assert before not in ("OFF", "FAULT")
            assert (cmd.run, cmd.source, cmd.session, cmd.version) == ("run", "controller", self.guard.session, 1)
            assert cmd.sequence > self.last[0]
            assert self.last[1] <= cmd.apply_at_sample <= now + lim.command_lead * RATE
            assert cmd.issued_sample <= min(cmd.apply_at_sample, now)
            assert max(cmd.apply_at_sample, now) <= cmd.expires_at_sample
            assert now - cmd.issued_sample <= lim.command_age * RATE
            self.last = cmd.sequence, cmd.apply_at_sample
            self.ladder.valid(now)
        return verdict

    @rule(shift_deg=st.floats(-4.9, 4.9), blocks=st.integers(1, 40))
    def cut(self, shift_deg, blocks):
        for _ in range(blocks):
            self.say(shift_deg)
            self.block()

    @rule(blocks=st.integers(1, 60))
    def silence(self, blocks):
        for _ in range(blocks):
            self.block()

    @rule()
    def bring_it_up(self):
        self.rig.conditions = {}
        self.block()
        self.request("reset")
        self.request("arm")
        self.block()

    @rule(shift_deg=WEIRD | st.floats(-6, 6), issued=SAMPLES, due=SAMPLES, expires=SAMPLES, sequence=st.integers(-9, 9))
    def forge(self, shift_deg, issued, due, expires, sequence):
        now, known = self.rig.now, self.rig.sequence
        times = {"issued_sample": now + issued, "apply_at_sample": now + due, "expires_at_sample": now + expires}
        self.say(shift_deg, sequence=known + sequence, **times)
        self.rig.sequence = max(known, known + sequence)

    @rule(changes=FOREIGN, shift_deg=st.floats(-4.9, 4.9))
    def another_commander(self, changes, shift_deg):
        assert not self.say(shift_deg, **changes).accepted

    @precondition(lambda self: self.last[0] >= 0)
    @rule(back=st.integers(0, 40))
    def replay_a_command(self, back):
        known = self.rig.sequence
        assert not self.say(1.0, sequence=max(self.last[0] - back, 0)).accepted
        self.rig.sequence = known

    @rule(conditions=CONDITIONS, blocks=st.integers(1, 5))
    def machine_changes(self, conditions, blocks):
        self.rig.conditions = conditions
        for _ in range(blocks):
            self.say(math.degrees(self.guard.requested))
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
        told, first = self.rig.state_of_machine(), self.rig.now
        ended = self.before in ("OFF", "ARMED", "FAULT") and not self.guard.moving
        checked = self.rig.block(BLOCK)
        issued, state = np.array(checked[:3]), self.guard.state
        recent = [np.repeat(self.rig.start[:, None], 4, axis=1), *self.rig.issued][-3:]
        assert worst(np.concatenate(recent, axis=1), self.rig.limits) <= 1.0
        self.ladder.block(first, state, told)
        assert self.ladder.broken == []
        if ended and state in ("OFF", "ARMED", "FAULT"):
            assert not np.ptp(issued, axis=1).any(), "motion after rest"
        assert not checked.followed or state in ("ACTIVE", "RETURNING")
        self.quiet = self.quiet + 1 if state in ("OFF", "ARMED", "FAULT", "HOLDING") else 0
        assert self.quiet * BLOCK <= 2 * RATE or not np.ptp(issued, axis=1).any(), "still moving after 2 s"
        assert not self.guard.feed_hold_requested or (state == "HOLDING" and told.in_cut)

    @invariant()
    def states_sessions_and_counts_agree(self):
        guard, state = self.guard, self.guard.state
        assert self.before != "FAULT" or state == "FAULT" or self.reset, "FAULT is left by reset alone"
        if state != "FAULT":
            self.reset = False
        assert (guard.session != "") is (state in LIVE)
        if guard.session not in self.sessions:
            self.last = -1, 0
            self.sessions.add(guard.session)
        elif state == "ARMED" != self.before:
            self.last = -1, 0
        assert len(self.sessions) == 1 + int((max(self.sessions) or "session--1")[8:]) + 1
        self.before = state
        assert guard.feed_inhibit_requested is (state == "FAULT")
        assert guard.commands_rejected == sum(guard.rejected.values())
        assert abs(guard.requested) <= guard.limits.shift
        if guard.moving and state in ("OFF", "ARMED", "FAULT"):
            assert guard.target == guard.requested

    def teardown(self):
        if not hasattr(self, "rig"):
            return
        for _ in range(40):
            self.block()
        self.rig.ask("stop")
        for _ in range(40):
            self.block()
        assert not self.guard.moving
        assert worst(self.rig.points(), self.rig.limits) <= 1.0


GuardMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=25)
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
