"""Where a router may listen, and whom it lets in."""

from __future__ import annotations

import re
import socket
import ssl

from services.errors import InputError, RefusalError
from services.security.identity import AUTHORITY, Identity, certificate_path, key_path

_PRIVATE = re.compile(r"(tcp|udp|ws)/(127(\.\d+){3}|localhost|\[::1\]):\d+|unixsock-stream/.+")
_PROVEN = ("tls/", "quic/")
_TLS = re.compile(r"tls/\[?(?P<host>[^\]/]+?)\]?:(?P<port>\d+)")
_PATIENCE_S = 0.5


def check_proof(field: str, endpoint: str, identity: Identity | None) -> None:
    """Hold that both sides of an endpoint prove who they are, or neither.

    Parameters
    ----------
    field
        Option that gave the endpoint.
    endpoint
        Of Zenoh.
    identity
        Who this is, None without certificates.
    """
    proven = endpoint.startswith(_PROVEN)
    if proven and identity is None:
        raise InputError(field, endpoint, "given with --identity DIR (`antiphase certs` makes such a folder)")
    if identity is not None and not proven:
        raise InputError(field, endpoint, "an endpoint that begins with tls/ when --identity is given")


def check_private(endpoint: str, identity: Identity | None) -> None:
    """Hold that nobody but this computer reaches a router that asks nobody who he is.

    Parameters
    ----------
    endpoint
        Where it is to listen.
    identity
        Who it is, None without certificates.
    """
    check_proof("listen", endpoint, identity)
    if identity is None and not _PRIVATE.fullmatch(endpoint):
        rule = "on 127.0.0.1, or tls/ with --identity DIR: whoever reaches an open router could move the turret"
        raise InputError("listen", endpoint, rule)


def refuse_stranger(endpoint: str, identity: Identity) -> None:
    """Say that a router does not let this identity in, or is not the one to be trusted; silent if nobody listens.

    Zenoh tells neither; a TLS handshake of its own does. A certificate that is refused shows in the first answer.

    Parameters
    ----------
    endpoint
        Where nobody could be reached.
    identity
        Who tried.
    """
    where = _TLS.fullmatch(endpoint)
    if where is None:
        return
    folder, role = identity.folder, identity.role
    context = ssl.create_default_context(cafile=str(folder / f"{AUTHORITY}.pem"))
    context.load_cert_chain(certificate_path(folder, role), key_path(folder, role))
    try:
        plain = socket.create_connection((where["host"], int(where["port"])), _PATIENCE_S)
        with plain, context.wrap_socket(plain, server_hostname=where["host"]) as link:
            link.recv(1)
    except ssl.SSLError as error:
        reason = (error.reason or str(error)).replace("_", " ").lower()
        why = f"{endpoint} does not let {role} of {folder} in, or is not to be trusted ({reason})"
        raise RefusalError(why, {"endpoint": endpoint, "role": role}) from error
    except OSError:
        return  # nobody listens there, or nobody answers
