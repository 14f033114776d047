"""What every session on the bus has in common, as settings of Zenoh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from services.security.identity import Identity
from services.wire import MOST_BYTES

LEASE_MS = 500
"""A peer that is silent for so long is gone."""
RECOVERY_MS = 200
"""How long a missing message is waited for."""


def session_settings(
    mode: str, *, listen: Sequence[str] = (), connect: Sequence[str] = (), identity: Identity | None = None
) -> dict[str, Any]:
    """Return the settings of a session: nobody is sought, nobody waits, and who is silent is gone soon.

    Parameters
    ----------
    mode
        `router` or `client`.
    listen, connect
        Endpoints.
    identity
        Who this is; None without certificates.
    """
    return {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "connect/timeout_ms": 0,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        "adminspace/enabled": mode == "router",  # it says where it listens; 1 KB of each client's would stay with it
        "timestamping/enabled": True,
        "queries_default_timeout": RECOVERY_MS,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/queue/size/data": 16,
        "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 0,
        "transport/link/rx/max_message_size": MOST_BYTES,  # the sender of a longer one is disconnected
        **(identity.settings(routes=mode == "router") if identity else {}),
    }
