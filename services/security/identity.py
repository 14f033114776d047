"""The identity of a process: its role, the certificate that proves it, and whom it trusts."""

from __future__ import annotations

import pathlib
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from services.errors import InputError
from services.security.rights import access_control

AUTHORITY = "authority"
SOON = timedelta(days=14)


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Certificates in a folder: `authority.pem`, `ROLE.pem`, `ROLE-key.pem`.

    Attributes
    ----------
    folder
        Where they lie.
    role
        The common name of the certificate.
    expires
        When it is no longer valid (UTC).
    """

    folder: pathlib.Path
    role: str
    expires: datetime

    def settings(self, *, routes: bool) -> dict[str, Any]:
        """Return the settings of Zenoh for a session with this identity; one that routes judges the others."""
        settings: dict[str, Any] = {
            "root_ca_certificate": str(self.folder / f"{AUTHORITY}.pem"),
            "enable_mtls": True,
            "verify_name_on_connect": True,
            "close_link_on_expiration": True,
        }
        for use in ("listen", "connect"):
            settings[f"{use}_private_key"] = str(key_path(self.folder, self.role))
            settings[f"{use}_certificate"] = str(certificate_path(self.folder, self.role))
        tls = {f"transport/link/tls/{name}": value for name, value in settings.items()}
        return tls | ({"access_control": access_control()} if routes else {})


def certificate_path(folder: pathlib.Path, role: str) -> pathlib.Path:
    """Return where the certificate of a role lies."""
    return folder / f"{role}.pem"


def key_path(folder: pathlib.Path, role: str) -> pathlib.Path:
    """Return where the private key of a role lies."""
    return folder / f"{role}-key.pem"


def load_identity(folder: pathlib.Path, role: str, now: datetime) -> Identity:
    """Return the identity of a role from a folder, looked through so that a bad one is told before anybody connects.

    Parameters
    ----------
    folder
        What `antiphase certs` makes.
    role
        Whose certificate.
    now
        Time of day (UTC).

    Raises
    ------
    InputError
        For a missing or unreadable file, a certificate of another role or authority, one that is not valid now, a
        key that does not belong to it or that others may read.
    """
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
    from cryptography.x509.oid import NameOID

    root_path, own_path, secret = folder / f"{AUTHORITY}.pem", certificate_path(folder, role), key_path(folder, role)
    for path in (root_path, own_path, secret):
        if not path.is_file():
            raise InputError("identity", str(path), "a file; `antiphase certs` makes a folder with one for each role")
    if secret.stat().st_mode & 0o077:
        raise InputError("identity", str(secret), "readable by its owner only (chmod 600)")
    try:
        root, own = (x509.load_pem_x509_certificate(path.read_bytes()) for path in (root_path, own_path))
        key: Any = load_pem_private_key(secret.read_bytes(), None)
        own.verify_directly_issued_by(root)
    except InvalidSignature as error:
        raise InputError("identity", str(own_path), f"signed by the authority in {root_path}") from error
    except (ValueError, TypeError, OSError) as error:
        raise InputError("identity", str(folder), f"certificates and keys in PEM ({error})") from error
    name = [str(part.value) for part in own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)]
    if name != [role]:
        raise InputError("identity", str(own_path), f"a certificate with the common name {role}, not {', '.join(name)}")
    if not own.not_valid_before_utc <= now <= own.not_valid_after_utc:
        span = f"{own.not_valid_before_utc:%Y-%m-%d %H:%M} to {own.not_valid_after_utc:%Y-%m-%d %H:%M} UTC"
        raise InputError("identity", str(own_path), f"valid now; it is from {span}")
    if key.public_key() != own.public_key():
        raise InputError("identity", str(secret), f"the key of {own_path}")
    return Identity(folder=folder.resolve(), role=role, expires=own.not_valid_after_utc)
