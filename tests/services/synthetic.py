"""Runs as the closed loop leaves them, made from formulas: chatter that grows from noise until turret 1 moves."""

from dataclasses import replace

import numpy as np

from services.messages import Event
from services.record import CutSeries, ReportSeries, RunRecord

RATE_HZ = 9000.0
BLOCK = 90
CHATTER_HZ = 652.0
FEED_MM_S = 3.0
SHIFT_DEG = 2.76


def growth(time_s, start_s, start_um, rate_1_s, ceiling_um):
    """Amplitude (um): exponential from `start_s`, bounded."""
    exponent = np.minimum(rate_1_s * np.maximum(time_s - start_s, 0.0), 40.0)
    return np.where(time_s < start_s, 0.0, np.minimum(start_um * np.exp(exponent), ceiling_um))


def settle(time_s, begin_s, length_s, height):
    """A smooth step from 0 to `height`."""
    u = np.clip((time_s - begin_s) / length_s, 0.0, 1.0)
    return height * (10 * u**3 - 15 * u**4 + 6 * u**5)


def cut_series(time_s, amplitude_um, shift_deg, entry_s, seed, roughness_um=1.5):
    """One cut whose vibration has the given amplitude, shape (n,)."""
    rng = np.random.default_rng(seed)
    n = time_s.size
    inside = (time_s >= entry_s).astype(float)
    phase = 2 * np.pi * CHATTER_HZ * time_s
    vibration = amplitude_um * np.sin(phase) + inside * 0.05 * rng.standard_normal(n)
    ring = inside * np.exp(-np.minimum(25.0 * np.maximum(time_s - entry_s, 0.0), 50.0))
    vibration = vibration + 6.0 * ring * np.sin(phase)
    force = inside * (75.0 - 60.0 * ring) + 1.1 * vibration * inside + 1.5 * rng.standard_normal(n)
    ra_position = np.arange(6.15, 6.0 + FEED_MM_S * max(time_s[-1] - entry_s, 0.0), 0.3) if n else np.zeros(0)
    return CutSeries(
        vibration_um=vibration,
        bar_displacement_um=inside * 12.0 * (1 - ring) + vibration,
        tool_radial_um=0.02 * rng.standard_normal(n),
        force_x1_n=force,
        force_y1p_n=2.4 * force + rng.standard_normal(n),
        shift_applied_deg=shift_deg,
        dx1_um=12500.0 * (1 - np.cos(np.radians(shift_deg))),
        dy1p_um=12500.0 * np.sin(np.radians(shift_deg)),
        z_mm=6.0 + FEED_MM_S * np.maximum(time_s - entry_s, 0.0),
        in_cut=inside,
        ra_position_mm=ra_position,
        ra_um=roughness_um + 0.083 * np.interp(entry_s + (ra_position - 6.0) / FEED_MM_S, time_s, amplitude_um)
        if n else np.zeros(0),
    )


def reports(blocks, entry_s, detected_s, commands, forced_kind=None):
    """What monitor and controller said; `commands` is a list of (time_s, shift_deg)."""
    first = np.arange(blocks) * float(BLOCK)
    ends = (first + BLOCK) / RATE_HZ
    noise = np.random.default_rng(9).uniform(0.85, 1.15, blocks)
    inside = ends > entry_s
    indicator = np.where(inside, 2.0, 0.6) * noise
    states, kinds, frequency = ["idle"] * blocks, [""] * blocks, np.full(blocks, np.nan)
    moved_s = commands[0][0] if commands else np.inf
    for i in range(blocks):
        if inside[i]:
            states[i] = "quiet"
        if detected_s is not None and ends[i] >= detected_s - 1e-9 and ends[i] < moved_s + 0.2:
            states[i], kinds[i], frequency[i] = "chatter", "regenerative", CHATTER_HZ + 0.4
        if forced_kind and inside[i] and ends[i] > entry_s + 0.5:
            states[i], kinds[i], frequency[i] = "chatter", forced_kind, 640.0
    if detected_s is not None:
        decay = np.exp(-np.maximum(ends - moved_s - 0.05, 0.0) * 20) if np.isfinite(moved_s) else 1.0
        swell = np.exp(np.minimum(60 * (ends - detected_s), 5.0)) * decay
        indicator = indicator + np.where(ends > entry_s + 0.05, 20.0 * swell, 0.0)
    requested = np.zeros(blocks)
    for time_s, shift_deg in commands:
        requested[ends >= time_s - 1e-9] = shift_deg
    return ReportSeries(
        first_sample=first, indicator=indicator, limit=np.where(ends < entry_s + 0.1, 5.0, 16.0),
        frequency_hz=frequency, amplitude_n=np.sqrt(indicator), confidence=np.where(np.isfinite(frequency), 0.9, 0.0),
        shift_requested_deg=requested, state=tuple(states), kind=tuple(kinds),
        limit_source=tuple("air" if t < entry_s else "configured" if t < entry_s + 1.5 else "cutting" for t in ends),
    )


def make_record(
    *, duration_s=6.0, entry_s=2.0, start_um=0.02, rate_1_s=30.0, decay_1_s=60.0, ceiling_um=55.0,
    detected_s=2.19, shift_deg=SHIFT_DEG, calm=True, interrupted=False, kind=None, events=None, seed=1,
):
    """A whole run; `detected_s=None` is a run without a move, `start_um=0` one without chatter."""
    n = round(duration_s * RATE_HZ)
    time_s = np.arange(n) / RATE_HZ
    twin = growth(time_s, entry_s, start_um, rate_1_s, ceiling_um)
    commands = [] if detected_s is None or shift_deg is None else [(detected_s, shift_deg)]
    shift, controlled = np.zeros(n), twin
    if commands and n:
        shift = settle(time_s, detected_s + 0.03, 0.05, shift_deg)
        fall = np.exp(-np.minimum(decay_1_s * np.maximum(time_s - detected_s - 0.06, 0.0), 50.0))
        held = growth(np.minimum(time_s, detected_s + 0.06), entry_s, start_um, rate_1_s, ceiling_um)
        controlled = np.where(time_s > detected_s + 0.06, held * fall, twin) if calm else twin
    said = reports(n // BLOCK, entry_s, detected_s, commands, kind)
    story = events if events is not None else default_events(entry_s, detected_s, shift_deg)
    return RunRecord(
        case="thesis-652", title="652 Hz chatter of a 25 mm bar between two turrets", seed=seed, sample_rate_hz=RATE_HZ,
        spindle_speed_rpm=1200.0, feed_mm_per_rev=0.15, diameter_mm=25.0, chatter_band_hz=(489.0, 815.0),
        search_band_hz=(500.0, 750.0), guard_limits=("shift = 0.087 rad (5 deg)", "on_loss = hold"), doubts=(),
        threshold_um=3.75, shift_limit_deg=6.0,
        controlled=cut_series(time_s, controlled, shift, entry_s, seed),
        twin=cut_series(time_s, twin, np.zeros(n), entry_s, seed),
        reports=said, events=tuple(story),
        counts={"commands_accepted": n // BLOCK, "commands_rejected": 0, "commands_late": 0, "blocks_lost": 0},
        loop_latency_ms=np.random.default_rng(3).gamma(4.0, 0.08, n // BLOCK), loop_wall_s=0.1 if n else 0.0,
        interrupted=interrupted, config_text='[workpiece]\nlength_mm = 160.0  # "overhang" <from chuck>\n',
        config_hash="9f2c51d0a7b3e8e4", versions={"antiphase": "0.1.0", "numpy": np.__version__, "python": "3.12.4"},
    )


def default_events(entry_s, detected_s, shift_deg):
    """The log of an ordinary run."""
    story = [(0.0, "guard", "armed by the run itself"), (0.0, "guard", "ARMED -> ACTIVE"),
             (1.0, "monitor", "limit learned in air: 5.0 N2"), (entry_s, "machine", "tools enter the cut")]
    if detected_s is not None:
        story.append((detected_s, "chatter", f"regenerative chatter at {CHATTER_HZ + 0.4:.1f} Hz"))
        if shift_deg is not None:
            story += [(detected_s, "command", f"move turret 1 to {shift_deg:.2f} deg"),
                      (detected_s + 0.03, "machine", "move begun"), (detected_s + 0.08, "machine", "move done")]
    return [event(time_s, kind, text) for time_s, kind, text in story]


def event(time_s, kind, text):
    """One line of the log."""
    return Event(run="r", source="machine", sequence=0, sample=round(time_s * RATE_HZ), kind=kind, text=text)


def with_twin(record, **changes):
    """The same run beside another twin."""
    return replace(record, twin=replace(record.twin, **changes))
