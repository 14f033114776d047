"""Planner: what it may never do under any input, and what it does in the cases that it is made for."""

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pitch import Cause, Planner, PlannerConfig, ProcessBelief, Situation, advise, optimal_pitch_difference

RATE, BLOCK = 9000.0, 90
CONFIG = PlannerConfig(sample_rate_hz=RATE)
ROOMY = PlannerConfig(sample_rate_hz=RATE, min_shift=-0.1, max_order=1, max_shift=0.17, y1_travel=(-4e-3, 4e-3))
CUTTING = Situation(
    sample=0,
    chatter=False,
    frequency_hz=None,
    kind=None,
    spindle_hz=20.0,
    diameter=0.025,
    shift=0.0,
    in_cut=True,
)
JUNK = st.sampled_from([None, math.nan, math.inf, -math.inf, 0.0, -5.0, 1e-300, 1e300])
SITUATIONS = st.builds(
    Situation,
    sample=st.integers(1, 40),  # blocks since the last one
    chatter=st.sampled_from([True, True, True, False]),
    frequency_hz=st.one_of(st.floats(300.0, 1500.0), st.sampled_from([612.0, 652.0, 692.0]), JUNK),
    kind=st.sampled_from(["regenerative", "regenerative", "regenerative", "forced", None, "odd"]),
    spindle_hz=st.one_of(st.just(20.0), st.floats(5.0, 50.0), JUNK),
    diameter=st.one_of(st.just(0.025), st.floats(0.005, 0.1), JUNK),
    shift=st.one_of(st.sampled_from(["target"] * 4 + ["zero"]), JUNK),
    in_cut=st.sampled_from([True, True, True, False]),
    valid=st.sampled_from([True, True, True, False]),
    moving=st.sampled_from([False, False, True]),
    armed=st.sampled_from([True, True, True, False]),
)


class Rig:
    """A turret that follows, and a clock in blocks."""

    def __init__(self, config=CONFIG, follows=True):
        self.planner, self.follows = Planner(config), follows
        self.sample, self.shift, self.moves, self.log = 0, 0.0, [], []

    def block(self, **what):
        self.sample += BLOCK
        moving = bool(self.moves) and self.sample - self.moves[-1][0] < 0.2 * RATE
        if self.follows and self.moves and not moving:
            self.shift = self.moves[-1][1]
        seen = replace(CUTTING, sample=self.sample, shift=self.shift, moving=moving)
        decision = self.planner.decide(replace(seen, **what))
        if decision.action == "move":
            self.moves.append((self.sample, decision.target_shift))
        self.log.append(decision)
        return decision

    def run(self, seconds, **what):
        return [self.block(**what) for _ in range(round(seconds * RATE / BLOCK))]

    def chatter(self, seconds, frequency_hz=652.0, **what):
        return self.run(seconds, chatter=True, kind="regenerative", frequency_hz=frequency_hz, **what)


def degrees(moves):
    return [math.degrees(target) for _, target in moves]


@given(st.sampled_from([CONFIG, ROOMY]), st.lists(SITUATIONS, max_size=60))
def test_what_it_may_never_do(config, blocks):
    planner, sample, target, moved_at, moves_without_calm, last_trouble = Planner(config), 0, 0.0, -math.inf, 0, 0
    found = False  # where turret 1 stands: until the first block that tells, there is nothing to hold
    for seen in blocks:
        shift = {"target": target, "zero": 0.0}.get(seen.shift, seen.shift)
        sample += seen.sample * BLOCK
        got = planner.decide(replace(seen, sample=sample, shift=shift))
        assert math.isfinite(got.target_shift)
        assert config.min_shift <= got.target_shift <= config.max_shift
        assert got.moves <= config.max_moves
        if got.action == "move":
            assert seen.chatter
            assert seen.in_cut
            assert seen.valid
            assert seen.armed
            assert not seen.moving
            assert seen.kind == "regenerative"
            assert all(x is not None and 0 < x < math.inf for x in (seen.frequency_hz, seen.spindle_hz, seen.diameter))
            assert sample - moved_at >= config.dwell * RATE
            moved_at, moves_without_calm = sample, moves_without_calm + 1
        elif seen.armed and found:
            assert got.target_shift == target
        found = found or (shift is not None and math.isfinite(shift))
        if sample - last_trouble >= config.calm_time * RATE:
            moves_without_calm = int(got.action == "move")
        if seen.chatter or not seen.valid:
            last_trouble = sample
        assert moves_without_calm <= config.max_moves
        assert advise(got).endswith(".")
        target = got.target_shift


@given(st.lists(SITUATIONS, max_size=40), st.lists(SITUATIONS, max_size=40))
def test_restore_repeats_the_future(before, after):
    def play(planner, blocks, sample):
        for seen in blocks:
            sample += seen.sample * BLOCK
            shift = {"target": 0.048, "zero": 0.0}.get(seen.shift, seen.shift)
            yield planner.decide(replace(seen, sample=sample, shift=shift))

    planner = Planner(ROOMY)
    list(play(planner, before, 0))
    state = planner.snapshot()
    first = list(play(planner, after, 10**6))
    planner.restore(state)
    assert list(play(planner, after, 10**6)) == first


@given(st.floats(400.0, 1500.0), st.floats(10.0, 20.0))
def test_the_first_command_comes_with_the_report_and_is_the_optimum(frequency, spindle):
    rig = Rig()
    rig.run(0.1)
    got = rig.chatter(0.01, frequency, spindle_hz=spindle)[0]
    assert got.action == "move"
    assert got.target_shift == pytest.approx(optimal_pitch_difference(frequency, spindle) / 2, rel=1e-12)


def test_one_move_is_enough_when_the_chatter_goes():
    rig = Rig()
    rig.chatter(0.5)
    rig.run(10.0)
    assert degrees(rig.moves) == pytest.approx([2.760736], rel=1e-6)
    assert rig.log[-1].target_shift == rig.moves[0][1]
    assert rig.log[-1].cause == Cause.QUIET


def test_it_re_aims_once_when_the_frequency_hops_after_the_move():
    rig = Rig()
    rig.chatter(0.4, 652.0)
    rig.chatter(1.0, 738.0)
    rig.run(2.0)
    assert degrees(rig.moves) == pytest.approx([2.760736, 2.439024], rel=1e-6)
    assert rig.moves[1][0] - rig.moves[0][0] >= CONFIG.dwell * RATE


def test_a_small_change_of_frequency_is_not_followed_but_the_next_phase_is_tried():
    rig = Rig()
    rig.chatter(0.5, 652.0)
    rig.chatter(0.6, 655.0)
    assert degrees(rig.moves)[1] == pytest.approx(0.85 * 2.760736 * 652 / 655, rel=1e-6)


def test_it_never_goes_back_to_a_shift_that_failed():
    rig = Rig()
    for frequency in (652.0, 738.0, 652.0, 738.0):
        rig.chatter(1.1, frequency)
    tried = degrees(rig.moves)
    assert len(tried) == 4
    assert min(abs(a - b) for i, a in enumerate(tried) for b in tried[:i]) > 0.1


def test_it_gives_up_after_four_moves_and_says_so_once():
    rig = Rig(replace(CONFIG, fallback_phases=(0.7 * math.pi, 0.85 * math.pi, 1.1 * math.pi)))
    rig.chatter(30.0)
    assert len(rig.moves) == 4
    assert [d.action for d in rig.log].count("give_up") == 1
    assert rig.log[-1].reason == "cannot stabilise after 4 moves: chatter still at 652 Hz"
    assert rig.log[-1].given_up
    assert "1163 or 1237 1/min" in advise(rig.log[-1])


def test_it_gives_up_when_every_pitch_has_been_tried():
    rig = Rig()
    rig.chatter(30.0)
    assert degrees(rig.moves) == pytest.approx([2.760736, 2.346626, 3.036810], rel=1e-6)
    assert rig.log[-1].cause == Cause.NO_PITCH
    assert "in spite of every pitch within the limits" in rig.log[-1].reason


def test_after_a_calm_spell_it_starts_anew():
    rig = Rig()
    rig.chatter(30.0)
    assert rig.log[-1].given_up
    rig.run(5.2)
    assert not rig.log[-1].given_up
    rig.chatter(0.01, 560.0)
    assert rig.log[-1].action == "move"


@pytest.mark.parametrize(
    ("config", "frequency", "said"),
    [
        (replace(CONFIG, y1_travel=(-5e-4, 5e-4)), 652.0, "no stable pitch within 2.00 mm of travel: 652 Hz at 1200"),
        (
            replace(CONFIG, y1_travel=(0.0, 5e-4), x1_travel=(-5e-4, 0.0)),
            652.0,
            "no stable pitch within 0.50 mm of travel",
        ),
        (CONFIG, 250.0, "no stable pitch within 6.00 deg: 250 Hz at 1200 1/min needs 7.20 deg"),
    ],
)
def test_an_honest_refusal(config, frequency, said):
    rig = Rig(replace(config, fallback_phases=()))
    got = rig.chatter(2.0, frequency)
    assert got[0].action == "give_up"
    assert got[0].reason.startswith(said)
    assert {d.action for d in got[1:]} == {"hold"}
    assert {d.target_shift for d in got} == {0.0}


def test_a_better_frequency_lifts_a_refusal():
    rig = Rig(replace(CONFIG, fallback_phases=()))
    assert rig.chatter(0.05, 290.0)[0].action == "give_up"
    assert rig.chatter(0.01, 320.0)[0].action == "move"


def test_a_lower_phase_is_used_where_only_that_fits():
    rig = Rig(replace(CONFIG, max_shift=math.radians(2.5)))
    got = rig.chatter(0.01)[0]
    assert got.phase == pytest.approx(0.85 * math.pi)
    assert math.degrees(got.target_shift) == pytest.approx(2.346626, rel=1e-6)


def test_the_mirrored_shift_is_used_where_only_that_fits():
    rig = Rig(replace(CONFIG, min_shift=-0.1, y1_travel=(-2e-3, 1e-4)))
    assert math.degrees(rig.chatter(0.01)[0].target_shift) == pytest.approx(-2.760736, rel=1e-6)


def test_the_next_order_is_the_last_resort():
    rig = Rig(ROOMY)
    rig.chatter(10.0)
    assert [d.order for d in rig.log if d.action == "move"] == [0, 0, 0, 1]
    assert degrees(rig.moves)[3] == pytest.approx(8.282209, rel=1e-6)


@pytest.mark.parametrize(
    ("what", "cause"),
    [
        ({"kind": "forced"}, Cause.FORCED),
        ({"kind": None}, Cause.KIND_UNKNOWN),
        ({"frequency_hz": None}, Cause.NO_FREQUENCY),
        ({"frequency_hz": math.nan}, Cause.BAD_DATA),
        ({"frequency_hz": -5.0}, Cause.BAD_DATA),
        ({"spindle_hz": None}, Cause.NO_SPINDLE_SPEED),
        ({"spindle_hz": 0.0}, Cause.BAD_DATA),
        ({"diameter": None}, Cause.BAD_DATA),
        ({"diameter": math.inf}, Cause.BAD_DATA),
        ({"shift": math.nan}, Cause.BAD_DATA),
        ({"in_cut": False}, Cause.OUT_OF_CUT),
        ({"valid": False}, Cause.BAD_DATA),
        ({"armed": False}, Cause.NOT_ARMED),
        ({"moving": True}, Cause.MOVING),
        ({"chatter": False}, Cause.QUIET),
    ],
)
def test_it_holds_and_says_why(what, cause):
    rig = Rig()
    seen = {"chatter": True, "kind": "regenerative", "frequency_hz": 652.0} | what
    got = rig.run(0.5, **seen)
    assert {d.action for d in got} == {"hold"}
    assert {d.target_shift for d in got} == {0.0}
    assert got[-1].cause == cause
    assert got[-1].reason


def test_a_turret_that_does_not_follow_is_reported():
    rig = Rig(follows=False)
    rig.chatter(3.0)
    assert len(rig.moves) == 1
    assert rig.log[-1].cause == Cause.NOT_FOLLOWED
    assert rig.log[-1].reason == "turret 1 does not follow: sent to 2.76 deg, it stands at 0.00 deg"


def test_a_restarted_planner_holds_where_the_turret_stands():
    got = Planner(CONFIG).decide(replace(CUTTING, sample=90, shift=0.048))
    assert (got.action, got.target_shift) == ("hold", 0.048)


def test_while_not_armed_the_target_follows_the_turret_and_arming_moves_at_once():
    rig = Rig()
    rig.chatter(0.5, armed=False)
    assert rig.log[-1].target_shift == 0.0
    rig.chatter(0.01)
    assert rig.log[-1].action == "move"
    rig.chatter(0.5)
    assert rig.run(0.01, armed=False, shift=0.01)[0].target_shift == 0.01


def test_late_and_repeated_blocks_change_nothing():
    planner = Planner(CONFIG)
    planner.decide(replace(CUTTING, sample=900))
    before = planner.snapshot()
    late = replace(CUTTING, sample=900, chatter=True, kind="regenerative", frequency_hz=652.0)
    assert planner.decide(late).cause == Cause.LATE
    assert planner.snapshot() == before


def test_a_gap_breaks_the_count_of_persisting_chatter():
    rig = Rig()
    rig.chatter(0.1)
    rig.run(0.5)
    rig.sample += round(2 * RATE)
    got = rig.chatter(0.2, 560.0)
    assert got[0].cause == Cause.WAITING
    assert got[-1].moves == 2


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("dwell", 0.5, "dwell must be in \\[1, 3600\\], got 0.5"),
        ("max_moves", 0, "max_moves must be a whole number >= 1, got 0"),
        ("max_shift", 0.6, "max_shift must be in"),
        ("max_shift", math.nan, "max_shift must be finite, got nan"),
        ("min_shift", 0.1, "min_shift must be in"),
        ("target_phase", 7.0, "must be in \\(0, 2 pi\\) rad, got 7.0"),
        ("fallback_phases", (0.0,), "must be in \\(0, 2 pi\\) rad, got 0.0"),
        ("order", 1, "max_order must be a whole number >= 1, got 0"),
        ("x1_travel", (1e-3, 2e-3), "x1_travel must be"),
        ("arrive_time", 0.5, "arrive_time must be in"),
        ("sample_rate_hz", -1.0, "sample_rate_hz must be > 0, got -1.0"),
        ("axis_angle", 4.0, "axis_angle must be in"),
        ("reaim_threshold", 0.0, "reaim_threshold must be > 0, got 0.0"),
    ],
)
def test_bad_configuration_names_value_and_rule(field, value, message):
    with pytest.raises(ValueError, match=message):
        replace(CONFIG, **{field: value})


BELIEF = ProcessBelief(
    modal_mass=0.21, natural_frequency_hz=430.0, damping_ratio=0.11, cutting_stiffness=1.0e6, overlap=0.83,
    process_damping=30.0,
)  # fmt: skip


def believing(config=CONFIG, **what):
    rig = Rig(config)
    rig.planner = Planner(config, belief=replace(BELIEF, **what))
    return rig


@given(st.lists(SITUATIONS, max_size=20))
def test_a_belief_never_leads_beyond_the_limits_and_is_the_same_twice(blocks):
    def play():
        planner, sample, target = Planner(ROOMY, belief=BELIEF), 0, 0.0
        for seen in blocks:
            sample += seen.sample * BLOCK
            shift = {"target": target, "zero": 0.0}.get(seen.shift, seen.shift)
            got = planner.decide(replace(seen, sample=sample, shift=shift))
            target = got.target_shift
            yield got

    first = list(play())
    assert first == list(play())
    assert all(ROOMY.min_shift <= got.target_shift <= ROOMY.max_shift for got in first)


def test_with_a_belief_it_aims_where_the_process_is_silent():
    rig = believing()
    rig.chatter(0.5)
    assert 2.0 < degrees(rig.moves)[0] < 3.6
    rig.run(6.0)
    assert len(rig.moves) == 1


def test_a_belief_in_another_bar_leaves_the_rule():
    rig = believing(natural_frequency_hz=1500.0)
    rig.chatter(0.1)
    assert degrees(rig.moves) == pytest.approx([2.760736], rel=1e-6)


def test_loud_chatter_is_answered_by_the_rule():
    rig = believing()
    rig.chatter(0.1, loudness=20.0)
    assert degrees(rig.moves) == pytest.approx([2.760736], rel=1e-6)


def test_what_worked_is_done_again_at_once():
    rig = Rig()
    rig.chatter(0.4, 652.0)
    rig.chatter(1.0, 738.0)
    rig.run(6.0)
    rig.run(0.1, armed=False, shift=0.0)
    rig.moves, rig.shift = [], 0.0
    rig.chatter(0.1, 652.0)
    assert degrees(rig.moves) == pytest.approx([2.439024], rel=1e-6)


def test_no_pitch_within_the_limits_names_a_speed_and_asks_for_feed_hold_once():
    tight = replace(CONFIG, max_shift=math.radians(1.0), fallback_phases=())
    rig = believing(tight)
    said = rig.chatter(3.0)
    assert [d.action for d in said].count("give_up") == 1
    assert said[-1].feed_hold
    assert said[-1].cause == Cause.NO_PITCH
    assert said[-1].reason.startswith("no stable pitch for 652 Hz at 1200 1/min within 1.00 deg")
    assert not rig.moves
