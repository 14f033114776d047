"""The sliding spectrum beside its peers: every sample, every hop, one call for each block, and its error for ever.

Peers without a band compute all of their bins, which is what whoever uses them pays.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import scipy.fft
import scipy.signal

from chatter import SlidingDFT
from services.bench import _spectrum_kernels as kernels
from services.bench.peers import CLOCK, Way, beside, installed, repeated
from services.bench.rounds import Row, Say, interleaved, row, silent
from services.messages import Floats

RATE, WINDOW, CHANNELS = 9000.0, 9000, 6
BAND = np.arange(500.0, 701.0)
BLOCK = 360
SAMPLE, HOP = (1e9, "ns/sample (less is faster)"), (1e6, "us/hop (less is faster)")
CORE, ERROR = "of a core (less is faster)", "of max (less is truer)"
TEXTBOOK = "the textbook's recursion in numba"


def measure(*, rounds: int = 7, samples: int = 10_000_000, say: Say = silent) -> list[Row]:
    """Return the rows of the table.

    Parameters
    ----------
    rounds
        How often each way is timed.
    samples
        Length of the stream whose error is measured.
    say
        Told what is being measured.
    """
    say("every sample")
    rows = [*each_sample_rows(rounds), *channel_rows(rounds), core_row(rounds)]
    say("longer hops of a long block")
    rows += [found for hop in (9, 90, 1000, 4000) for found in hop_rows(hop, rounds)]
    say("one update for each hop")
    rows += [found for hop in (9, 90, 100) for found in update_rows(hop, rounds)]
    say("error after a long stream")
    return rows + error_rows(samples)


def _sliding(channels: int = 1) -> SlidingDFT:
    """Return a filled window that begins a span, as after whole blocks of 10 ms."""
    sliding = SlidingDFT(BAND, WINDOW, RATE, channels)
    sliding.update(_noise(WINDOW, channels))
    return sliding


def _noise(samples: int, channels: int = 1) -> Floats:
    return np.random.default_rng(samples + channels).standard_normal((samples, channels))


def each_sample_rows(rounds: int) -> list[Row]:
    """Return the rows of one channel, the power of every bin after every sample, or the largest of them."""
    block, one = _noise(BLOCK), _noise(WINDOW)[:, 0]
    state: list[Any] = [np.zeros(WINDOW), 0, np.zeros(BAND.size, complex), np.exp(2j * np.pi * BAND / RATE)]
    power = np.empty((BLOCK, BAND.size))
    peers = {
        TEXTBOOK: repeated(partial(kernels.recursion, block[:, 0], *state, power), BLOCK),
        "the same in numpy": repeated(partial(_recursion, block[:, 0], *state, power), BLOCK),
        "scipy rfft": repeated(partial(scipy.fft.rfft, one)),
        "scipy ShortTimeFFT": _short_time(20),
        "sdft of PyPI": _sdft(20),
    }
    few = {name: peers[name] for name in (TEXTBOOK, "scipy rfft")}
    powers, largest = (repeated(partial(way, block), BLOCK) for way in (_sliding().power, _sliding().maximum))
    case = f"hop 1, power of {BAND.size} bins"
    rows = beside(case, powers, peers, rounds, *SAMPLE)
    rows.append(row(f"{case}, beside its arithmetic alone", rows[0]["ours"], _arithmetic(rounds), SAMPLE[1]))
    return rows + beside(f"hop 1, largest power of {BAND.size} bins", largest, few, rounds, *SAMPLE)


def channel_rows(rounds: int) -> list[Row]:
    """Return the rows of six channels, every sample; the unit is a sample of all of them."""
    block, windows, sdft = _noise(90, CHANNELS), np.ascontiguousarray(_noise(WINDOW, CHANNELS).T), _sdft(20)
    peers = {
        "scipy rfft": repeated(partial(scipy.fft.rfft, windows, axis=1)),
        "six sdft of PyPI": None if sdft is None else Way(sdft.call, sdft.units / CHANNELS),
    }
    ours = repeated(partial(_sliding(CHANNELS).power, block), len(block))
    return beside(f"hop 1, power of {BAND.size} bins, {CHANNELS} channels", ours, peers, rounds, *SAMPLE)


def core_row(rounds: int) -> Row:
    """Return the share of a core that one update for each 9 samples of six channels takes at 9 kHz."""
    ours = repeated(partial(_sliding(CHANNELS).update, _noise(9, CHANNELS)), 9)
    return row(f"update of 9 samples, {CHANNELS} channels at 9 kHz", _time(ours, rounds, RATE), None, CORE)


def hop_rows(hop: int, rounds: int) -> list[Row]:
    """Return the rows of spectra of a long block at one hop."""
    block, one = _noise(max(WINDOW, 9 * hop)), _noise(WINDOW)[:, 0]
    zoom = scipy.signal.ZoomFFT(WINDOW, [BAND[0], BAND[-1]], m=BAND.size, fs=round(RATE), endpoint=True)
    peers = {
        "scipy rfft": repeated(partial(scipy.fft.rfft, one)),
        "pyfftw": _pyfftw(one),
        "scipy ZoomFFT": repeated(partial(zoom, one)),
    }
    ours = repeated(partial(_sliding().spectra, block, hop), len(block) // hop)
    return beside(f"hop {hop}, {BAND.size} bins of a long block", ours, peers, rounds, *HOP)


def update_rows(hop: int, rounds: int) -> list[Row]:
    """Return the rows of one update for each hop, six channels."""
    windows = np.ascontiguousarray(_noise(WINDOW, CHANNELS).T)
    peers = {
        "scipy rfft": repeated(partial(scipy.fft.rfft, windows, axis=1)),
        "pyfftw": _pyfftw(windows),
    }
    ours = repeated(partial(_sliding(CHANNELS).update, _noise(hop, CHANNELS)))
    return beside(f"update of {hop} samples, {CHANNELS} channels", ours, peers, rounds, *HOP)


def error_rows(samples: int) -> list[Row]:
    """Return the largest error over the largest bin, ours and the recursion's, after more and more samples."""
    stream = np.random.default_rng(1).standard_normal(samples)
    sliding, ring, spectrum = SlidingDFT(BAND, WINDOW, RATE), np.zeros(WINDOW), np.zeros(BAND.size, complex)
    rows: list[Row] = []
    for length in (samples // 100, samples // 10, samples):
        exact = _exact(stream[length - WINDOW : length])
        got = sliding.update(stream[sliding.seen : length])[0]
        ring[:], spectrum[:] = 0.0, 0.0
        kernels.slide(stream[:length], ring, spectrum, np.exp(2j * np.pi * BAND / RATE))
        ours, peer = (float(np.abs(x - exact).max() / np.abs(exact).max()) for x in (got, spectrum))
        rows.append(row(f"error after {length:.0e} samples, beside {TEXTBOOK}", ours, peer, ERROR))
    return rows


def _arithmetic(rounds: int) -> float:
    """Return what two products and sums for the recursion and two for the power of eight bins take (ns)."""
    turns = 100_000
    core = repeated(partial(kernels.multiply_add, np.full(80, 0.5), turns), 8.0 * turns)
    return 4.0 * -(-BAND.size // 8) * _time(core, rounds, 1e9)


def _time(way: Way, rounds: int, scale: float) -> float:
    taken, _ = interleaved({"": way.call}, rounds, CLOCK)
    return scale * taken[""] / way.units


def _recursion(samples: Floats, ring: Floats, position: int, spectrum: Any, twiddles: Any, power: Floats) -> None:
    for i, sample in enumerate(samples):
        change = sample - ring[position]
        ring[position] = sample
        position = (position + 1) % ring.size
        spectrum += change
        spectrum *= twiddles
        power[i] = spectrum.real**2 + spectrum.imag**2


def _short_time(samples: int) -> Way:
    transform, middle = scipy.signal.ShortTimeFFT(np.ones(WINDOW), 1, RATE), WINDOW // 2
    stream = _noise(WINDOW + samples)[:, 0]
    return repeated(partial(transform.spectrogram, stream, p0=middle, p1=middle + samples), samples)


def _sdft(samples: int) -> Way | None:
    """Return the bins of a window of as many samples, all of them: there is no band."""
    module = installed("sdft")
    if module is None:
        return None
    return repeated(partial(module.SDFT(WINDOW // 2, "boxcar").sdft, _noise(samples)[:, 0]), samples)


def _pyfftw(windows: Floats) -> Way | None:
    module = installed("pyfftw")
    if module is None:
        return None
    plan = module.builders.rfft(windows.copy(), axis=-1, threads=1, planner_effort="FFTW_MEASURE")
    return repeated(partial(plan, windows))


def _exact(window: Floats) -> Any:
    """Return the spectrum of a window, from integer phases and sums of long floats."""
    turns = np.outer(np.arange(WINDOW), BAND.astype(int)) % WINDOW
    phase = 2.0 * np.longdouble(np.pi) * np.arange(WINDOW) / WINDOW
    wave = np.cos(phase) - 1j * np.sin(phase)
    return (window.astype(np.longdouble) @ wave[turns]).astype(complex)
