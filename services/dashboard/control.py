"""The only way from the page to the machine; without `--allow-control` there is none."""

from __future__ import annotations

import secrets

from services.dashboard.hub import Hub
from services.errors import InputError, RefusalError
from services.messages import OperatorRequest

REQUESTS = ("arm", "disarm", "stop", "reset")


class Control:
    """Hands the requests of whoever knows the token to the guard of the machine.

    Parameters
    ----------
    hub
        Knows the run, and the bus.
    token
        What the page must show; a new one is drawn when it is None.
    """

    def __init__(self, hub: Hub, token: str | None = None) -> None:
        self._hub = hub
        self.token = token or secrets.token_urlsafe(18)
        hub.controls = REQUESTS

    def admits(self, authorization: str) -> bool:
        """Whether a header `Authorization` holds the token."""
        return secrets.compare_digest(authorization.encode(), f"Bearer {self.token}".encode())

    def ask(self, request: object) -> dict[str, str]:
        """Publish a request; the answer is the state that the machine publishes.

        Raises
        ------
        InputError
            For what is no request.
        RefusalError
            When there is nobody to ask.
        """
        if not isinstance(request, str) or request not in REQUESTS:
            raise InputError("request", request, f"one of {', '.join(REQUESTS)}")
        run = self._hub.view.sieve.run
        if not run:
            raise RefusalError("nothing was heard of the machine yet")
        nonce = secrets.token_hex(8)
        message = OperatorRequest(run=run, source="operator", sequence=0, request=request, nonce=nonce)  # pyright: ignore[reportArgumentType]
        self._hub.feed.publish(message)
        return {"request": request, "nonce": nonce}
