"""What a block stands in: is the sensor well, do the tools cut, which lines are the machine's own."""

from copy import deepcopy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter.cut_state import CutState
from chatter.estimate import MonitorConfig, Note
from chatter.input_check import InputCheck
from chatter.limits import noise_between
from chatter.line_kinds import Scene
from chatter.surroundings import Surroundings

Floats = NDArray[np.float64]


class Context:
    """Completes what the caller knows about a block by what the samples say.

    Parameters
    ----------
    config : MonitorConfig
        Parameters.
    sample_rate_hz : float
        Sampling rate (Hz).
    channels : int
        Number of channels.
    """

    def __init__(self, config: MonitorConfig, sample_rate_hz: float, channels: int) -> None:
        self._config, self._sample_rate_hz, self._channels = config, sample_rate_hz, channels
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._check = InputCheck(self._channels)
        self._cut = CutState(self._channels)
        self._surroundings = Surroundings(self._sample_rate_hz, self._config.speed_uncertainty)

    def restart(self) -> None:
        """Forget the present second after a gap."""
        self._surroundings.restart()

    def snapshot(self) -> Any:
        """Return a copy of the whole state."""
        return deepcopy((self._check, self._cut, self._surroundings))

    def restore(self, state: Any) -> None:
        """Continue from a copy of the state.

        Parameters
        ----------
        state : object
            What `snapshot` returned.
        """
        self._check, self._cut, self._surroundings = deepcopy(state)

    def examine(self, block: Floats, in_cut: bool | None) -> tuple[bool, tuple[Note, ...]]:
        """Return whether a block can be judged at all, and what is wrong with it.

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came, all finite.
        in_cut : bool or None
            Whether the tools cut; None when nobody knows.
        """
        notes = self._check.look(block)
        folded = "duplicated" in notes and self._config.band_hz[1] > 0.25 * self._sample_rate_hz
        dead = "constant" in notes and in_cut is not False
        return not (dead or folded or "repeated" in notes), notes

    def complete(self, block: Floats, power: Floats, told: Scene) -> tuple[Scene, tuple[Note, ...], float | None]:
        """Return what is known about a block, notes on it, and the comb that contradicts the speed (Hz).

        Parameters
        ----------
        block : ndarray, shape (n, channels)
            Samples as they came.
        power : ndarray, shape (bins,)
            Squared line amplitude in every bin.
        told : Scene
            What the caller knows.
        """
        notes: list[Note] = [] if told.spindle_hz else ["speed_unknown"]
        in_cut = told.in_cut
        if in_cut is None:
            in_cut = self._cut.look(block, noise_between(power))
            notes.append("cut_unknown" if in_cut is None else "cut_inferred")
        around = self._surroundings
        scene = Scene(
            in_cut=in_cut,
            spindle_hz=told.spindle_hz,
            moving=told.moving,
            encoder_hz=told.encoder_hz,
            tones=around.tones,
            doubtful=around.comb_hz is not None,
        )
        around.look(block, scene)
        if around.comb_hz is not None:
            notes.append("speed_contradicted")
        return scene, tuple(notes), around.comb_hz
