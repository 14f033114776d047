"""How the skin says no: wrong use (exit code 2) and an honest refusal (exit code 3)."""

from __future__ import annotations


class InputError(ValueError):
    """A field of a file, an option or a message breaks a rule.

    Parameters
    ----------
    field
        Name of the field, option or key.
    value
        What was found there; None when the field is missing.
    rule
        What it must be, in words.
    """

    def __init__(self, field: str, value: object, rule: str) -> None:
        self.field, self.value, self.rule = field, value, rule
        got = "it is missing" if value is None else f"got {value!r}"
        super().__init__(f"{field} must be {rule}; {got}")

    def as_dict(self) -> dict[str, object]:
        """Return the JSON form of the error."""
        value = self.value if isinstance(self.value, bool | int | float | str | None) else repr(self.value)
        return {"field": self.field, "value": value, "rule": self.rule, "message": str(self)}


class RefusalError(Exception):
    """The question is well put, but an answer would be dishonest.

    Parameters
    ----------
    reason
        Why, with the numbers.
    payload
        The normal keys of the verb, as far as they are known.
    """

    def __init__(self, reason: str, payload: dict[str, object] | None = None) -> None:
        self.reason = reason
        self.payload: dict[str, object] = payload or {}
        super().__init__(reason)
