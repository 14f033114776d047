"""The numbers of a run, from its record, each as the contract of the command line defines it.

*Vibration* is the displacement between bar and tool 1 along X1, band-passed over the chatter band (zero phase, so
that times stay true), as a 5 ms envelope: sqrt(2) times the moving RMS, which is the amplitude of a sine and,
unlike a peak detector, is not moved by one noisy sample. At 600 Hz the ripple left in it is under 3 %.
"""

# SciPy has no complete type stubs.
# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
# pyright: reportUnknownVariableType=false, reportUnknownArgumentType=false

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from services.messages import BLOCK_S, Floats
from services.record import CutSeries, RunRecord

ENVELOPE_S = 0.005
ONSET_HOLD_S = 0.020
SUPPRESSED_HOLD_S = 0.5
MISSED_S = 0.1
"""A run stopped by hand sooner than this after onset has not missed the chatter yet (s)."""
FIRST_SHIFT_DEG = 0.02
"""Departure of the realised shift (deg) that counts as moving: 4 um on a 25 mm bar, ten times the servo error."""
CHATTER_STATE = "chatter"
"""The `state` of a report that raises the alarm."""
FORCED_KIND = "forced"
"""The `kind` of a line that follows the spindle: an alarm, but not chatter."""
GIVE_UP_EVENT = "give_up"
"""The `kind` of the event by which the controller says that no pitch helps, and why."""

Mask = NDArray[np.bool_]


def vibration_envelope(displacement: Floats, sample_rate_hz: float, band_hz: tuple[float, float]) -> Floats:
    """Amplitude of the band-passed displacement, same unit and shape (n,)."""
    if displacement.size == 0:
        return np.zeros(0)
    in_band = band_passed(displacement, sample_rate_hz, band_hz)
    window = 2 * round(0.5 * (ENVELOPE_S * sample_rate_hz - 1)) + 1
    power = ndimage.uniform_filter1d(in_band**2, window, mode="nearest")
    return np.sqrt(2.0 * np.maximum(power, 0.0))


def band_passed(displacement: Floats, sample_rate_hz: float, band_hz: tuple[float, float]) -> Floats:
    """Displacement within a band, without delay, same unit and shape (n,), n > 0."""
    sos = signal.butter(4, band_hz, btype="bandpass", fs=sample_rate_hz, output="sos")
    return signal.sosfiltfilt(sos, displacement, padlen=min(int(0.05 * sample_rate_hz), displacement.size - 1))


def envelope_um(record: RunRecord, cut: CutSeries) -> Floats:
    """Vibration (um) of one of the two cuts of `record`, shape (n,)."""
    return vibration_envelope(cut.vibration_um, record.sample_rate_hz, record.chatter_band_hz)


def first_held(mask: Mask, hold: int, start: int = 0) -> int | None:
    """First index from `start` at which `mask` stays true for `hold` samples, None when there is none."""
    padded = np.concatenate(([False], mask[start:], [False])).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    begins, ends = edges[::2], edges[1::2]
    long_enough = begins[ends - begins >= max(hold, 1)]
    return start + int(long_enough[0]) if long_enough.size else None


def judged(record: RunRecord, cut: CutSeries) -> Mask:
    """Where a cut is judged: in the cut, at least one revolution after the tools entered it; shape (n,)."""
    inside = cut.in_cut > 0.5
    entry = first_held(inside, 1)
    if entry is not None:
        inside[: entry + int(np.ceil(60.0 / record.spindle_speed_rpm * record.sample_rate_hz))] = False
    return inside


def entry_time(record: RunRecord) -> float | None:
    """When the tools of the controlled cut entered the part (s)."""
    entry = first_held(record.controlled.in_cut > 0.5, 1)
    return None if entry is None else entry / record.sample_rate_hz


def onset_time(record: RunRecord) -> float | None:
    """`chatter_onset_s`: when the uncontrolled twin rose above the threshold and stayed there for 20 ms (s)."""
    above = (envelope_um(record, record.twin) > record.threshold_um) & judged(record, record.twin)
    onset = first_held(above, round(ONSET_HOLD_S * record.sample_rate_hz))
    return None if onset is None else onset / record.sample_rate_hz


def block_end(record: RunRecord, block: int) -> float:
    """When report number `block` of the series was due (s): the end of its block."""
    return float(record.reports.first_sample[block]) / record.sample_rate_hz + BLOCK_S


def detection_block(record: RunRecord) -> int | None:
    """Find the first report that says chatter, and not that the vibration is forced."""
    said = zip(record.reports.state, record.reports.kind, strict=True)
    return next((i for i, (state, kind) in enumerate(said) if state == CHATTER_STATE and kind != FORCED_KIND), None)


def forced_block(record: RunRecord) -> int | None:
    """Find the first report whose alarm is a vibration forced by the spindle."""
    said = zip(record.reports.state, record.reports.kind, strict=True)
    return next((i for i, (state, kind) in enumerate(said) if state == CHATTER_STATE and kind == FORCED_KIND), None)


def command_blocks(record: RunRecord) -> NDArray[np.intp]:
    """Find the reports whose command asked for another shift than the one before, shape (moves,).

    NaN is no command, as before the guard is armed; the first one is compared with where the turret stood.
    """
    requested = record.reports.shift_requested_deg
    told = np.flatnonzero(np.isfinite(requested))
    moves = told[1:][np.abs(np.diff(requested[told])) > 1e-9]
    if told.size and abs(float(requested[told[0]]) - _applied_at(record, int(told[0]))) > FIRST_SHIFT_DEG:
        return np.concatenate((told[:1], moves))
    return moves


def _applied_at(record: RunRecord, block: int) -> float:
    """Give the realised shift at the start of a block (deg), 0 when nothing was recorded."""
    applied = record.controlled.shift_applied_deg
    first = round(float(record.reports.first_sample[block]))
    return float(applied[min(first, applied.size - 1)]) if applied.size else 0.0


def first_shift_time(record: RunRecord) -> float | None:
    """When turret 1 really began its first commanded move (s)."""
    commands = command_blocks(record)
    if commands.size == 0:
        return None
    start = round(block_end(record, int(commands[0])) * record.sample_rate_hz)
    applied = record.controlled.shift_applied_deg
    if start >= applied.size:
        return None
    moved = first_held(np.abs(applied - applied[start]) > FIRST_SHIFT_DEG, 1, start)
    return None if moved is None else moved / record.sample_rate_hz


def suppressed_time(record: RunRecord) -> float | None:
    """`suppressed_s`: from when, after the first shift, the controlled cut stayed below the threshold for 0.5 s (s).

    The half second counts only while the tools are in the cut: leaving the part is not suppression.
    """
    shifted = first_shift_time(record)
    if shifted is None or not record.has_truth:
        return None
    below = (envelope_um(record, record.controlled) < record.threshold_um) & (record.controlled.in_cut > 0.5)
    rate = record.sample_rate_hz
    calm = first_held(below, round(SUPPRESSED_HOLD_S * rate), round(shifted * rate))
    return None if calm is None else calm / rate


def marked_length(record: RunRecord, cut: CutSeries) -> float | None:
    """Length of part cut above the threshold (mm), None when the part was never reached, or nobody knows."""
    where = judged(record, cut)
    if not np.any(cut.in_cut > 0.5) or cut.vibration_um.size == 0:
        return None
    above = np.count_nonzero((envelope_um(record, cut) > record.threshold_um) & where)
    feed_rate_mm_s = record.feed_mm_per_rev * record.spindle_speed_rpm / 60.0
    return feed_rate_mm_s * int(above) / record.sample_rate_hz


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """The keys of `demo` and `run`; None where a thing did not happen.

    Attributes
    ----------
    outcome
        One word for all: `no_cut`, `stable`, `forced`, `missed`, `not_moved`, `gave_up`, `not_suppressed`,
        `suppressed`, `prevented` (moved before the threshold was passed), `false_alarm` (the twin never passed it)
        or `undecided` (the run ended before it could be judged); of a recording without a twin `no_alarm`,
        `alarm_ended` (within its last half second there is none) or `alarm_lasts`.
    doubts
        What lies outside the range of the model, in words; nothing if all is well.
    """

    case: str
    seed: int
    outcome: str
    interrupted: bool
    simulated_s: float
    entered_cut_s: float | None
    chatter_onset_s: float | None
    detected_s: float | None
    detection_latency_s: float | None
    chatter_hz: float | None
    pitch_difference_deg: float | None
    shift_deg: float | None
    first_command_s: float | None
    first_shift_s: float | None
    suppressed_s: float | None
    ra_before_um: float | None
    ra_after_um: float | None
    marked_length_mm: float | None
    marked_length_twin_mm: float | None
    peak_vibration_um: float | None
    peak_vibration_twin_um: float | None
    max_shift_deg: float
    moves: int
    limit_source: str | None
    gave_up_reason: str | None
    doubts: tuple[str, ...]
    commands_accepted: int
    commands_rejected: int
    commands_late: int
    blocks_lost: int
    loop_p50_ms: float | None
    loop_p99_ms: float | None
    real_time_factor: float | None
    total_wall_s: float | None

    def as_dict(self) -> dict[str, object]:
        """Keys and plain values, ready for JSON."""
        return asdict(self)


SUMMARY_KEYS = tuple(field.name for field in fields(Summary))


def summarize(
    record: RunRecord,
    *,
    ra_before_um: float | None = None,
    ra_after_um: float | None = None,
    total_wall_s: float | None = None,
) -> Summary:
    """All numbers of a run; the roughness of the two stretches and the wall time come from whoever ran it."""
    rate = record.sample_rate_hz
    onset, detection, commands = onset_time(record), detection_block(record), command_blocks(record)
    detected = None if detection is None else block_end(record, detection)
    shift = float(record.reports.shift_requested_deg[commands[0]]) if commands.size else None
    simulated = record.controlled.shift_applied_deg.size / rate
    return Summary(
        case=record.case,
        seed=record.seed,
        outcome=_outcome(record, onset),
        interrupted=record.interrupted,
        simulated_s=simulated,
        entered_cut_s=entry_time(record),
        chatter_onset_s=onset,
        detected_s=detected,
        detection_latency_s=None if detected is None or onset is None else detected - onset,
        chatter_hz=_first_frequency(record, detection),
        pitch_difference_deg=None if shift is None else 2.0 * shift,
        shift_deg=shift,
        first_command_s=block_end(record, int(commands[0])) if commands.size else None,
        first_shift_s=first_shift_time(record),
        suppressed_s=suppressed_time(record),
        ra_before_um=ra_before_um,
        ra_after_um=ra_after_um,
        marked_length_mm=marked_length(record, record.controlled),
        marked_length_twin_mm=marked_length(record, record.twin),
        peak_vibration_um=_peak(record, record.controlled),
        peak_vibration_twin_um=_peak(record, record.twin),
        max_shift_deg=float(np.max(np.abs(record.controlled.shift_applied_deg), initial=0.0)),
        moves=int(commands.size),
        limit_source=_limit_source(record, detection),
        gave_up_reason=next((e.text for e in record.events if e.kind == GIVE_UP_EVENT), None),
        doubts=record.doubts,
        commands_accepted=record.counts.get("commands_accepted", 0),
        commands_rejected=record.counts.get("commands_rejected", 0),
        commands_late=record.counts.get("commands_late", 0),
        blocks_lost=record.counts.get("blocks_lost", 0),
        loop_p50_ms=_percentile(record.loop_latency_ms, 50.0),
        loop_p99_ms=_percentile(record.loop_latency_ms, 99.0),
        real_time_factor=simulated / record.loop_wall_s if record.loop_wall_s > 0.0 else None,
        total_wall_s=total_wall_s,
    )


def _outcome(record: RunRecord, onset: float | None) -> str:
    if entry_time(record) is None:
        return "no_cut"
    if any(event.kind == GIVE_UP_EVENT for event in record.events):
        return "gave_up"
    if not record.has_twin:
        return _outcome_alone(record)
    if detection_block(record) is None:
        if not np.any(judged(record, record.controlled)):
            return "undecided"
        if onset is not None:
            return "missed" if not record.interrupted or _judged_after(record, onset) > MISSED_S else "undecided"
        return "stable" if forced_block(record) is None else "forced"
    if command_blocks(record).size == 0:
        return "not_moved" if onset is not None or record.interrupted else "false_alarm"
    return _outcome_of_move(record, onset)


def _outcome_alone(record: RunRecord) -> str:
    """Judge a recording by what the monitor said, when there is no cut without control to set beside it."""
    if detection_block(record) is None:
        return "no_alarm" if forced_block(record) is None else "forced"
    if command_blocks(record).size == 0:
        return "not_moved"
    last = record.reports.state[-round(SUPPRESSED_HOLD_S / BLOCK_S) :]
    return "alarm_lasts" if CHATTER_STATE in last else "alarm_ended"


def _outcome_of_move(record: RunRecord, onset: float | None) -> str:
    calm = suppressed_time(record) is not None
    if calm and onset is not None:
        return "suppressed" if marked_length(record, record.controlled) else "prevented"
    if onset is None:
        return "undecided" if record.interrupted else "false_alarm"
    shifted = first_shift_time(record)
    enough = shifted is not None and _judged_after(record, shifted) >= SUPPRESSED_HOLD_S
    return "not_suppressed" if enough and not record.interrupted else "undecided"


def _judged_after(record: RunRecord, time_s: float) -> float:
    """Measure how long the controlled cut was judged after a moment (s)."""
    after = judged(record, record.controlled)[round(time_s * record.sample_rate_hz) :]
    return int(np.count_nonzero(after)) / record.sample_rate_hz


def _peak(record: RunRecord, cut: CutSeries) -> float | None:
    where = judged(record, cut)
    return float(np.max(envelope_um(record, cut)[where])) if np.any(where) and cut.vibration_um.size else None


def _first_frequency(record: RunRecord, detection: int | None) -> float | None:
    if detection is None:
        return None
    told = record.reports.frequency_hz[detection:]
    told = told[np.isfinite(told)]
    return float(told[0]) if told.size else None


def _limit_source(record: RunRecord, detection: int | None) -> str | None:
    """Name the source of the limit that was passed; without a detection, the last one in force."""
    sources = record.reports.limit_source
    if not sources:
        return None
    return sources[-1 if detection is None else detection] or None


def _percentile(values: Floats, percent: float) -> float | None:
    return float(np.percentile(values, percent)) if values.size else None
