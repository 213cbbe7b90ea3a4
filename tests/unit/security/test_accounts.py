"""Accounts of the page: how passwords are kept, and what is no file of accounts."""

from __future__ import annotations

from pathlib import Path

import pytest

from heel.schemas.errors import SettingsError
from heel.services.security.accounts import (
    Account,
    as_text,
    checked_password,
    hashed,
    matches,
    new_password,
    read_accounts,
)


def test_a_password_is_kept_as_a_salted_hash_alone() -> None:
    kept = hashed("correct horse")
    assert "correct" not in kept
    assert kept != hashed("correct horse")
    assert matches("correct horse", kept)
    assert not matches("correct horse ", kept)
    assert not matches("x" * 100_000, kept)


def test_new_passwords_are_long_and_never_the_same() -> None:
    made = {new_password() for _ in range(20)}
    assert len(made) == 20
    assert all(len(one) == 19 and checked_password(one) for one in made)
    for odd in ("short", "x" * 300):
        with pytest.raises(SettingsError, match="10 to 256 characters"):
            checked_password(odd)


def test_accounts_come_back_from_their_file(tmp_path: Path) -> None:
    accounts = {
        "anna": Account("operate", hashed("a" * 10)),
        "ben": Account("watch", hashed("b" * 10)),
    }
    file = tmp_path / "users"
    file.write_text(as_text(accounts))
    file.chmod(0o600)
    assert read_accounts(file) == accounts


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        ("", 0o600, "names nobody"),
        ("anna:secret\n", 0o600, "line 1"),
        ("anna:king:{kept}\n", 0o600, "line 1"),
        ("an na:watch:{kept}\n", 0o600, "line 1"),
        ("anna:watch:scrypt$2$8$1$AAAA$AAAA\n", 0o600, "line 1"),
        ("anna:watch:{kept}\n", 0o640, "chmod 600"),
        ("anna:watch:{kept}\n", 0o606, "chmod 600"),
    ],
)
def test_a_file_that_would_let_in_whom_nobody_meant_is_refused(
    text: str, mode: int, said: str, tmp_path: Path
) -> None:
    file = tmp_path / "users"
    file.write_text(text.format(kept=hashed("correct horse")))
    file.chmod(mode)
    with pytest.raises(SettingsError, match=said) as error:
        read_accounts(file)
    assert "scrypt" not in str(error.value)
