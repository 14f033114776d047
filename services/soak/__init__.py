"""The services under load and link cuts, and what became of every message."""
