"""What one run of the loop leaves behind: the series that metrics, figures and report are made from."""

from __future__ import annotations

from dataclasses import dataclass

from services.messages import Event, Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class CutSeries:
    """The samples of one cut, shape (n,) each at the servo rate, starting at sample 0.

    Attributes
    ----------
    vibration_um
        Displacement between bar and tool 1 along X1 (um); what no sensor sees.
    bar_displacement_um
        Displacement of the bar at the tools along X1 (um).
    tool_radial_um
        Radial departure of tool 1 from its arc (um).
    force_x1_n, force_y1p_n
        Estimated cutting force on tool 1 (N).
    shift_applied_deg, dx1_um, dy1p_um
        Realised shift of turret 1 (deg) and the offset of its tool (um).
    z_mm
        Position of the tools from the tip of the bar (mm).
    in_cut
        Whether the tools are in the cut.
    ra_position_mm, ra_um
        Roughness of the finished surface, shape (k,): middle of each stretch (mm) and its Ra (um).
    """

    vibration_um: Floats
    bar_displacement_um: Floats
    tool_radial_um: Floats
    force_x1_n: Floats
    force_y1p_n: Floats
    shift_applied_deg: Floats
    dx1_um: Floats
    dy1p_um: Floats
    z_mm: Floats
    in_cut: Floats
    ra_position_mm: Floats
    ra_um: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportSeries:
    """One value per block, shape (b,) each: what monitor and controller said.

    `frequency_hz` is NaN where none was given; `state`, `kind` and `limit_source` are words.
    """

    first_sample: Floats
    indicator: Floats
    limit: Floats
    frequency_hz: Floats
    amplitude_n: Floats
    confidence: Floats
    shift_requested_deg: Floats
    state: tuple[str, ...]
    kind: tuple[str, ...]
    limit_source: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRecord:
    """A closed-loop run and its uncontrolled twin (the same seed, never moved).

    A recording may lack the twin, and the truth that only a simulated machine tells: then those series are empty. Times
    count from its first sample, `origin_s` after the machine's.
    `chatter_band_hz` is where vibration is judged, `search_band_hz` where the monitor looks for chatter;
    `guard_limits` are all limits of the guard in words, `doubts` what lies outside the range of the model;
    `false_alarms_per_h` is how often stationary noise passes the limit of the monitor. `effects` are label, value and
    meaning of what the shift that was commanded or advised leaves on the part, `alternatives` what else could be done.
    """

    case: str
    title: str
    seed: int
    sample_rate_hz: float
    spindle_speed_rpm: float
    feed_mm_per_rev: float
    diameter_mm: float
    chatter_band_hz: tuple[float, float]
    search_band_hz: tuple[float, float]
    threshold_um: float
    shift_limit_deg: float
    guard_limits: tuple[str, ...]
    doubts: tuple[str, ...]
    controlled: CutSeries
    twin: CutSeries
    reports: ReportSeries
    events: tuple[Event, ...]
    counts: dict[str, int]
    loop_latency_ms: Floats
    loop_wall_s: float
    interrupted: bool
    config_text: str
    config_hash: str
    versions: dict[str, str]
    false_alarms_per_h: float | None = None
    effects: tuple[tuple[str, str, str], ...] = ()
    alternatives: tuple[str, ...] = ()
    origin_s: float = 0.0

    @property
    def has_twin(self) -> bool:
        """Whether a cut without control is known."""
        return self.twin.shift_applied_deg.size > 0

    @property
    def has_truth(self) -> bool:
        """Whether it is known what the bar did."""
        return self.controlled.vibration_um.size > 0
