"""Figures of runs and recordings; the only place that imports matplotlib, so import it only when drawing."""

from services.figures.cut import motion_figure, roughness_figure
from services.figures.decision import indicator_figure, shift_figure
from services.figures.force import spectrogram_figure
from services.figures.hero import overview_figure
from services.figures.recording import Episode, detection_figure, write_detection_figure
from services.figures.view import View
from services.figures.write import FIGURES, write_figures

__all__ = [
    "FIGURES",
    "Episode",
    "View",
    "detection_figure",
    "indicator_figure",
    "motion_figure",
    "overview_figure",
    "roughness_figure",
    "shift_figure",
    "spectrogram_figure",
    "write_detection_figure",
    "write_figures",
]
