"""Less cutting stiffness silences the cut; how much less is a matter of damping."""

import pytest

from services.linear_theory import strongest_root, with_stiffness
from services.open_cut import cut_open
from services.reproduce.plant import prepared_case


def growth(case, factor):
    return strongest_root(with_stiffness(case, factor), case.settings.start_position, 0.0).real


def test_half_the_stiffness_silences_the_depth_of_table_6_2():
    """130 mm projection at 0.2 mm: the border is at three quarters of the fitted stiffness."""
    case = prepared_case("lumped", "thesis-depth-02")
    assert growth(case, 1.0) == pytest.approx(9.0, abs=0.1)
    assert growth(case, 0.5) == pytest.approx(-12.9, abs=0.1)
    assert cut_open(case, 1, 0.0, 6e-3).chatter
    assert not cut_open(with_stiffness(case, 0.5), 1, 0.0, 6e-3).chatter


def test_half_the_stiffness_only_slows_the_long_bar_whose_border_is_at_a_third():
    """160 mm projection: growth falls from 29.9 to 10.4 1/s at half, and passes zero at 0.356 of the stiffness."""
    case = prepared_case("lumped", "thesis-652")
    assert growth(case, 0.5) == pytest.approx(10.4, abs=0.1)
    assert growth(case, 0.37) > 0.0 > growth(case, 0.35)
    assert cut_open(with_stiffness(case, 0.5), 1, 0.0, 6e-3).chatter
    assert not cut_open(with_stiffness(case, 0.33), 1, 0.0, 6e-3).chatter


def test_the_map_is_silent_too_where_the_force_law_is_a_third():
    case = prepared_case("surface", "thesis-652")
    assert cut_open(case, 1, 0.0, 3e-3).chatter
    assert not cut_open(with_stiffness(case, 0.33), 1, 0.0, 3e-3).chatter
