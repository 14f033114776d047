"""All figures of a run as files."""

# pyright: reportUnknownMemberType=false

from __future__ import annotations

from pathlib import Path

from services.figures.cut import motion_figure, roughness_figure
from services.figures.decision import indicator_figure, shift_figure
from services.figures.force import spectrogram_figure
from services.figures.hero import overview_figure
from services.figures.view import View
from services.metrics import Summary
from services.record import RunRecord

FIGURES = {
    "overview": overview_figure,
    "spectrograms": spectrogram_figure,
    "indicator": indicator_figure,
    "shift": shift_figure,
    "motion": motion_figure,
    "roughness": roughness_figure,
}


def write_figures(record: RunRecord, summary: Summary, directory: Path) -> list[Path]:
    """Write every figure of a run as PNG into `directory` and list the files."""
    directory.mkdir(parents=True, exist_ok=True)
    view = View.of(record, summary)
    written: list[Path] = []
    for name, draw in FIGURES.items():
        path = directory / f"{name}.png"
        draw(view).savefig(path, metadata={"Software": None})
        written.append(path)
    return written
