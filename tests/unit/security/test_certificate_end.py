"""When a certificate ends, read from the file that `heel security` or another has made."""

from __future__ import annotations

import datetime
from pathlib import Path

import pytest

from heel.services.runtime.certificate import end_of_pem

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")

from heel.services.security.certificates import Certified, certify, new_authority
from heel.services.security.folder import SecurityFolder


@pytest.mark.parametrize("days", [20.0, 800.0, 3640.0, 36500.0])
def test_the_end_is_that_of_the_first_certificate(days: float, tmp_path: Path) -> None:
    authority = new_authority("Heel robot", 40000)
    made: Certified = certify(authority, "page", days, ("localhost", "::1"))
    file = tmp_path / "page.pem"
    for content in (made.certificate + made.key, made.key + made.certificate,
                    made.certificate + authority.certificate):  # fmt: skip
        file.write_bytes(content)
        found = end_of_pem(file)
        assert found is not None
        assert abs(found - made.until) < datetime.timedelta(seconds=2)


@pytest.mark.parametrize(
    "content", [b"", b"nothing", b"\xff", b"-----BEGIN CERTIFICATE-----\nAAAA"]
)
def test_what_is_no_certificate_has_no_end(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "page.pem"
    file.write_bytes(content)
    assert end_of_pem(file) is None
    assert end_of_pem(tmp_path / "missing.pem") is None


def test_the_page_s_own_file_is_read(tmp_path: Path) -> None:
    folder = SecurityFolder.create(tmp_path / "keys", days=90)
    until = end_of_pem(folder.folder / "page.pem")
    assert until is not None
    assert abs(until - folder.members.until["page.pem"]) < datetime.timedelta(seconds=2)
