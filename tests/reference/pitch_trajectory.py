"""Plain twin of the trajectory filter: one sample at a time, exact fractions, no running sums."""

from fractions import Fraction


def fir_path(start: int, goals: list[int], step: int, first: int, second: int) -> list[Fraction]:
    """Path (counts) for one goal per sample: rate limiter, then the mean of the last `first`, then of `second`."""
    level, levels, means, path = start, [start] * first, [Fraction(start)] * second, []
    for goal in goals:
        level += max(-step, min(step, goal - level))
        levels = [*levels[1:], level]
        means = [*means[1:], Fraction(sum(levels), first)]
        path.append(sum(means) / second)
    return path
