"""The `antiphase` command."""
