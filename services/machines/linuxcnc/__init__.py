"""LinuxCNC as the machine: turret 1 is shifted through the external offsets of two of its axes."""
