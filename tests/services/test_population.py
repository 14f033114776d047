"""The population is what it says, and most of it is silenced."""

import numpy as np
import pytest

from pitch import OneModeProcess, roots
from services.bench.population import draw
from services.bench.population.measure import Size, measure
from services.bench.population.trial import try_process


@pytest.fixture(scope="module")
def processes():
    return [draw.population_process(1, number) for number in range(8)]


def growth(process, shift):
    cut, case = process.case.cutting, process.case
    true = draw.true_process(case.workpiece, cut, case.settings.start_position)
    bar = OneModeProcess(
        true.modal_mass, true.natural_frequency_hz, true.damping_ratio, true.overlap, true.process_damping
    )
    found = roots(bar, true.cutting_stiffness, cut.spindle_hz, 2.0 * shift, count=20)
    return found[found.imag > np.pi * true.natural_frequency_hz][0].real


def test_each_process_chatters_at_equal_pitch_and_has_a_stable_pitch(processes):
    for process in processes:
        assert growth(process, 0.0) == pytest.approx(process.growth, abs=1e-4)
        assert draw.GROWTH[0] <= process.growth <= draw.GROWTH[1]
        assert 600.0 <= 60.0 * process.case.cutting.spindle_hz <= 3000.0
        assert process.best_decay >= draw.DECAY
        assert 0.0 < process.share <= 1.0


def test_the_controller_believes_something_else_than_the_truth(processes):
    for process in processes:
        case = process.case
        true = draw.true_process(case.workpiece, case.cutting, case.settings.start_position)
        for name, most in draw.WRONG.items():
            ratio = getattr(case.foresight, name) / getattr(true, name)
            assert 0.0 < abs(ratio - 1.0) <= most + 1e-12


def test_a_process_is_the_same_twice_and_so_is_its_trial(processes):
    again = draw.population_process(1, 2)
    assert again.case.cutting == processes[2].case.cutting
    assert try_process(again, foresight=True) == try_process(processes[2], foresight=True)


def test_the_first_of_the_population_are_silenced_with_at_most_two_moves(processes):
    done = [try_process(process, foresight=True) for process in processes]
    assert all(trial.suppressed and 1 <= trial.moves <= 2 for trial in done)
    assert all(trial.quiet_after_s < 2.0 for trial in done)


def test_the_table_says_both_planners_and_what_failed():
    told = []
    rows, numbers = measure(Size(processes=3, loops=1), seed=1, workers=1, progress=told.append)
    assert told[-1] == pytest.approx(1.0)
    assert [row["peer"] is None for row in rows] == [False] * 6 + [True] * 3
    assert rows[0]["ours"] == rows[6]["ours"] == 1.0
    assert set(numbers["not_silenced"]) == {
        "heard at its onset, foresight", "heard at its onset, rule", "grown for 0.8 s, foresight",
        "grown for 0.8 s, rule", "full loop",
    }  # fmt: skip
