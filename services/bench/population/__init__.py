"""Whether the planner silences what it should: processes drawn at random, beside the plain rule."""
