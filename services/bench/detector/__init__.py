"""How fast, how exact and how quiet the detector is, against the truth of many simulated cuts and beside its rivals."""
