"""Tests of Antiphase; never installed."""
