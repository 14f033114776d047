"""Randomised bad days of the closed loop, and what must hold on each of them."""
