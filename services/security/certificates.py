"""The robot's own certificate authority, and what it certifies: names of clients and of servers.

Written with `cryptography` (the extra `secure`), which nothing else here needs: who only uses a
certificate has it in a file of Zenoh's.
"""

from __future__ import annotations

import datetime
import ipaddress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from heel.schemas.errors import HeelError

if TYPE_CHECKING:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey

_BACKDATED = datetime.timedelta(days=1)
"""How long certificates have been valid when they are made: a robot's clock may be behind."""


@dataclass(frozen=True, slots=True)
class Certified:
    """A certificate with its private key, both as PEM, and the last moment that it is valid."""

    certificate: bytes
    key: bytes
    until: datetime.datetime


def new_authority(name: str, days: int) -> Certified:
    """A certificate authority.

    Args:
        name: of it, as browsers show it.
        days: that it is valid.

    Raises:
        HeelError: `cryptography` is not installed.
    """
    x509, _ = _library()
    key = _new_key()
    subject = _common_name(name)
    builder = _builder(subject, subject, key.public_key(), days).add_extension(
        x509.BasicConstraints(ca=True, path_length=0), critical=True
    )
    builder = builder.add_extension(_usage(signs_certificates=True), critical=True)
    return _signed(builder, key, key)


def certify(
    authority: Certified, name: str, days: float, server_names: tuple[str, ...] = ()
) -> Certified:
    """A certificate signed by the authority, not valid for longer than itself.

    Args:
        authority: that signs.
        name: of the client or server; the router knows clients by it.
        days: that it is valid.
        server_names: host names and IP addresses under which it serves; none: a client's.

    Raises:
        HeelError: `cryptography` is not installed.
    """
    x509, serialization = _library()
    from cryptography.x509.oid import ExtendedKeyUsageOID

    signing: Any = serialization.load_pem_private_key(authority.key, None)
    issuer = x509.load_pem_x509_certificate(authority.certificate)
    key = _new_key()
    builder = _builder(
        _common_name(name), issuer.subject, key.public_key(), days, issuer.not_valid_after_utc
    )
    kind = ExtendedKeyUsageOID.SERVER_AUTH if server_names else ExtendedKeyUsageOID.CLIENT_AUTH
    for extension, critical in (
        (x509.BasicConstraints(ca=False, path_length=None), True),
        (_usage(signs_certificates=False), True),
        (x509.ExtendedKeyUsage([kind]), False),
        (x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), False),
    ):
        builder = builder.add_extension(extension, critical)
    if server_names:
        names = x509.SubjectAlternativeName([_alternative(one) for one in server_names])
        builder = builder.add_extension(names, critical=False)
    return _signed(builder, key, signing)


def _library() -> tuple[Any, Any]:
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import serialization
    except ImportError:
        raise HeelError(
            "certificates are made with cryptography, which is not installed: "
            "pip install cryptography segno, or choose --passwords"
        ) from None
    return x509, serialization


def _new_key() -> EllipticCurvePrivateKey:
    from cryptography.hazmat.primitives.asymmetric import ec

    return ec.generate_private_key(ec.SECP256R1())


def _common_name(name: str) -> x509.Name:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _builder(
    subject: x509.Name, issuer: x509.Name, public_key: Any, days: float,
    latest: datetime.datetime | None = None,
) -> x509.CertificateBuilder:  # fmt: skip
    from cryptography import x509

    now = datetime.datetime.now(datetime.UTC)
    until = now + datetime.timedelta(days=days)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _BACKDATED)
        .not_valid_after(until if latest is None else min(until, latest))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public_key), critical=False)
    )


def _usage(signs_certificates: bool) -> x509.KeyUsage:
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=not signs_certificates, key_cert_sign=signs_certificates,
        crl_sign=signs_certificates, content_commitment=False, key_encipherment=False,
        data_encipherment=False, key_agreement=False, encipher_only=False, decipher_only=False,
    )  # fmt: skip


def _alternative(name: str) -> x509.GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name)


def _signed(
    builder: x509.CertificateBuilder, key: EllipticCurvePrivateKey, signing: Any
) -> Certified:
    from cryptography.hazmat.primitives import hashes, serialization

    certificate = builder.sign(signing, hashes.SHA256())
    private = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    return Certified(
        certificate.public_bytes(serialization.Encoding.PEM), private,
        certificate.not_valid_after_utc,
    )  # fmt: skip
