"""All rows on cutting force without a sensor, and what the figures are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from services.reproduce.estimators.choice import Situation, Trade, study_situations, study_trades
from services.reproduce.estimators.guide import GuideScene, guide_rows, study_guides
from services.reproduce.estimators.idling import Idling, idling_rows, study_idling
from services.reproduce.estimators.milling import MillingStudy, milling_rows, study_milling
from services.reproduce.estimators.others import Kalman, other_rows, study_kalman
from services.reproduce.estimators.resolution import Resolution, resolution_rows, study_resolution
from services.reproduce.estimators.response import response_rows
from services.reproduce.estimators.tables import table_rows
from services.reproduce.rows import Row

Progress = Callable[[float], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimators:
    """All rows, and the studies behind them."""

    rows: tuple[Row, ...]
    resolution: Resolution
    milling: MillingStudy
    idling: Idling
    kalman: Kalman
    guides: tuple[GuideScene, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What tells a user which estimator to take."""

    situations: tuple[Situation, ...]
    trades: tuple[Trade, ...]


def reproduce_estimators(progress: Progress | None = None) -> Estimators:
    """Compute every row; nothing is random but the noise of encoders, which has fixed seeds.

    Parameters
    ----------
    progress
        Told the share that is done, 0...1.
    """
    tell = progress or (lambda _: None)
    resolution = study_resolution()
    tell(0.3)
    milling = study_milling()
    tell(0.5)
    idling = study_idling()
    tell(0.7)
    kalman = study_kalman()
    guides = study_guides()
    tell(0.9)
    rows = [
        *table_rows(),
        *response_rows(),
        *resolution_rows(resolution),
        *milling_rows(milling),
        *idling_rows(idling),
        *other_rows(kalman),
        *guide_rows(guides),
    ]
    return Estimators(
        rows=tuple(_named(row) for row in rows),
        resolution=resolution,
        milling=milling,
        idling=idling,
        kalman=kalman,
        guides=guides,
    )


def _named(row: Row) -> Row:
    """Say of what nothing is said that it is the thesis."""
    if row.source.startswith(("fitting paper", "damping paper", "current thesis")):
        return row
    return replace(row, source=f"thesis, {row.source}")


def study_choice() -> Choice:
    """Compare all estimators in several situations, and the family over its weight."""
    return Choice(situations=study_situations(), trades=study_trades())
