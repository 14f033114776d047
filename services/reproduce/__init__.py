"""Published numbers beside what the model computes."""
