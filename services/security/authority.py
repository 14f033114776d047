"""A development authority: one private key that vouches for one certificate a role, all in one folder."""

from __future__ import annotations

import ipaddress
import os
import pathlib
from collections.abc import Sequence
from datetime import datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from services.errors import InputError
from services.security.identity import AUTHORITY, certificate_path, key_path
from services.security.rights import ROLES, ROUTER

CN = "antiphase development authority"
LOCAL = ("localhost", "127.0.0.1", "::1")


def make_authority(
    folder: pathlib.Path, days: int, now: datetime, hosts: Sequence[str] = (), roles: Sequence[str] = ()
) -> list[str]:
    """Make an authority and a certificate for every role in an empty folder; return the names of the files.

    Parameters
    ----------
    folder
        Made if it is missing; files of an authority that lies there are never overwritten.
    days
        For how long all of it is valid.
    now
        Time of day (UTC); it begins an hour before, for clocks that are late.
    hosts
        Names and addresses under which routers are reached, besides this computer's own loopback.
    roles
        Some of `ROLES` and `router`; all when empty.

    Raises
    ------
    InputError
        For a folder that holds an authority, a role that there is not, days out of 1 to 3650.
    """
    known = (ROUTER, *ROLES)
    for role in roles:
        if role not in known:
            raise InputError("role", role, f"one of {', '.join(known)}")
    if not 1 <= days <= 3650:
        raise InputError("days", days, "in 1..3650")
    if (folder / f"{AUTHORITY}.pem").exists():
        raise InputError("out", str(folder), "a folder without an authority: take another one, or delete that first")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    start = now - timedelta(hours=1)
    until = now + timedelta(days=days)
    key = ec.generate_private_key(ec.SECP256R1())
    root = _root(key, start, until)
    _write_key(folder / f"{AUTHORITY}-key.pem", key)
    written = [f"{AUTHORITY}-key.pem"]
    for role in roles or known:
        own = ec.generate_private_key(ec.SECP256R1())
        certificate = _leaf(role, own, root, key, [*LOCAL, *hosts], start, until)
        _write_key(key_path(folder, role), own)
        certificate_path(folder, role).write_bytes(certificate.public_bytes(serialization.Encoding.PEM))
        written += [key_path(folder, role).name, certificate_path(folder, role).name]
    (folder / f"{AUTHORITY}.pem").write_bytes(root.public_bytes(serialization.Encoding.PEM))
    return [*written, f"{AUTHORITY}.pem"]


def _root(key: ec.EllipticCurvePrivateKey, start: datetime, until: datetime) -> x509.Certificate:
    name = _name(CN)
    return (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number(), start, until)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(signs=True), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )


def _leaf(
    role: str, key: ec.EllipticCurvePrivateKey, root: x509.Certificate, root_key: ec.EllipticCurvePrivateKey,
    hosts: Sequence[str], start: datetime, until: datetime,
) -> x509.Certificate:  # fmt: skip
    both = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(root_key.public_key())
    return (
        x509.CertificateBuilder(root.subject, _name(role), key.public_key(), x509.random_serial_number(), start, until)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(signs=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage(both), critical=False)
        .add_extension(x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False)
        .add_extension(issuer, critical=False)
        .sign(root_key, hashes.SHA256())
    )


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text)])


def _host(text: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(text))
    except ValueError:
        pass
    try:
        return x509.DNSName(text)
    except ValueError as error:
        raise InputError("host", text, "the name or the address of a computer") from error


def _usage(*, signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs, key_cert_sign=signs, crl_sign=signs, content_commitment=False,
        key_encipherment=False, data_encipherment=False, key_agreement=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip


def _write_key(path: pathlib.Path, key: ec.EllipticCurvePrivateKey) -> None:
    """Write a private key that only its owner may read; it is never readable by others, not even for a moment."""
    text = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(text)
