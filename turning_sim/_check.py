"""One sentence for every refused argument."""

from __future__ import annotations


def require(condition: bool, name: str, rule: str, value: object) -> None:
    """Raise ValueError with name, rule and value unless the condition holds."""
    if not condition:
        raise ValueError(f"{name} must be {rule}, got {value}")
