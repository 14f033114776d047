"""How a case is run and judged."""

from __future__ import annotations

from dataclasses import dataclass

ESTIMATORS = (
    "load_side", "standing", "optimal", "vibration", "medob", "blended", "fitted", "damping", "dob", "thrust", "kalman",
)  # fmt: skip
"""Names that a case may give; `chatter.observers.named.NAMES`, without importing it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseSettings:
    """How a case is run and judged (SI).

    Attributes
    ----------
    title
        One line for people.
    seed
        Of every random number unless the command line gives another.
    machine
        Name of the machine in the keys of the bus.
    sample_rate_hz
        Of servo and observers.
    force_estimator
        Name of the estimator of the cutting force.
    force_cutoff_hz
        Low-pass of the force estimate.
    start_position, air_time, cut_time
        Tools from the tip at entry (m), time in air before it and time in the cut after it (s).
    reference_chatter_hz
        Predicted chatter frequency: nominal phases refer to it, and the judged band lies about it.
    threshold
        Fraction of the feed per tool at which vibration counts as chatter.
    apply_after_blocks, expires_after_blocks
        When a command takes effect and when it is void, in blocks after the one that caused it.
    """

    title: str
    seed: int
    machine: str
    sample_rate_hz: float
    force_estimator: str
    force_cutoff_hz: float
    start_position: float
    air_time: float
    cut_time: float
    reference_chatter_hz: float
    threshold: float
    apply_after_blocks: int
    expires_after_blocks: int

    def __post_init__(self) -> None:
        rules = {
            "seed": (self.seed >= 0, "a whole number, 0 or more"),
            "machine": (bool(self.machine) and set(self.machine) <= _KEY, "letters, digits, - and _"),
            "sample_rate_hz": (1000.0 <= self.sample_rate_hz <= 100e3, "in 1000..100000"),
            "force_estimator": (self.force_estimator in ESTIMATORS, f"one of {', '.join(ESTIMATORS)}"),
            "force_cutoff_hz": (0.0 < self.force_cutoff_hz < self.sample_rate_hz / 2, "in (0, rate / 2)"),
            "start_position": (self.start_position >= 0.0, "0 or more"),
            "air_time": (0.0 <= self.air_time <= 600.0, "in 0..600"),
            "cut_time": (0.0 < self.cut_time <= 3600.0, "above 0, at most 3600"),
            "reference_chatter_hz": (0.0 < self.reference_chatter_hz < self.sample_rate_hz / 3, "in (0, rate / 3)"),
            "threshold": (0.0 < self.threshold < 1.0, "in (0, 1)"),
            "apply_after_blocks": (2 <= self.apply_after_blocks <= 100, "in 2..100"),
            "expires_after_blocks": (self.expires_after_blocks > self.apply_after_blocks, "above apply_after_blocks"),
        }
        for name, (holds, rule) in rules.items():
            if not holds:
                raise ValueError(f"{name} must be {rule}, got {getattr(self, name)!r}")
        if abs(self.sample_rate_hz * 0.01 % 1.0) > 1e-9:
            raise ValueError(f"sample_rate_hz must be a multiple of 100, got {self.sample_rate_hz}")


_KEY = set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_")
