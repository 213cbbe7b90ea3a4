"""The folder of certificates: what is in it, who may read it, and that nothing is overwritten."""

from __future__ import annotations

import datetime
import json
import ssl
import stat
from pathlib import Path

import pytest
import zenoh

from heel.schemas.errors import SettingsError
from heel.services.commands.doctor.gather import certificate_days
from heel.services.runtime.router import RouterSettings, router_config
from heel.services.runtime.session import zenoh_config
from heel.services.runtime.settings import ZenohSettings
from heel.services.security.folder import SecurityFolder
from heel.services.security.roles import SERVICES

pytest.importorskip("cryptography", reason="the extra `secure` is not installed")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> SecurityFolder:
    folder = tmp_path_factory.mktemp("security") / "keys"
    return SecurityFolder.create(folder, hosts=("robot.example",), namespace="robots/r1")


def subjects(made: SecurityFolder) -> set[str]:
    config = zenoh.Config.from_file(str(made.file_of("router")))
    table = json.loads(config.get_json("access_control"))
    return {name for one in table["subjects"] for name in one["cert_common_names"]}


def test_there_is_a_file_for_the_router_every_service_and_an_operator(
    made: SecurityFolder,
) -> None:
    files = {file.stem for file in made.folder.glob("*.json5")}
    assert files == {"router", *SERVICES, "operator"}
    assert subjects(made) == files - {"router"}


def test_only_the_owner_reads_what_is_secret(made: SecurityFolder) -> None:
    assert stat.S_IMODE(made.folder.stat().st_mode) == 0o700
    for file in made.folder.iterdir():
        wanted = 0o644 if file.name == "authority.crt" else 0o600
        assert stat.S_IMODE(file.stat().st_mode) == wanted, file.name
        assert (
            file.name == "authority.key"
            or b"BEGIN PRIVATE" not in file.read_bytes()
            or (file.name == "page.pem")
        )


def test_a_second_init_refuses_and_changes_nothing(made: SecurityFolder) -> None:
    before = {file: file.read_bytes() for file in made.folder.iterdir()}
    with pytest.raises(SettingsError, match="is not empty"):
        SecurityFolder.create(made.folder)
    assert {file: file.read_bytes() for file in made.folder.iterdir()} == before


def test_services_and_router_take_their_addresses_from_the_files(made: SecurityFolder) -> None:
    settings = ZenohSettings(config_file=made.file_of("detector"))
    assert settings.connect == ("tls/127.0.0.1:7447",)
    assert settings.namespace == "robots/r1"
    config = zenoh_config(settings)
    assert "so_sndbuf" in config.get_json("connect/endpoints")
    assert json.loads(config.get_json("metadata"))["heel"]["role"] == "detector"
    moved = ZenohSettings(config_file=made.file_of("detector"), connect=("tls/far:1",))
    assert moved.connect == ("tls/far:1",)
    router = RouterSettings(config_file=made.file_of("router"))
    assert router.listen == ("tls/0.0.0.0:7447",)
    limits = json.loads(router_config(router).get_json("low_pass_filter"))
    assert {"size of command", "small-queries"} <= {one["id"] for one in limits}


def test_the_doctor_reads_when_a_members_certificate_ends(
    made: SecurityFolder, tmp_path: Path
) -> None:
    days = certificate_days(made.file_of("operator"))
    assert days is not None
    assert 729 < days <= 730
    other = tmp_path / "zenoh.json5"
    other.write_text('{metadata: {name: "x"}}')
    assert certificate_days(other) is None
    assert certificate_days(None) is None


def test_the_page_has_a_certificate_of_the_robots_names(made: SecurityFolder) -> None:
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(made.folder / "page.pem")
    from cryptography import x509

    page = x509.load_pem_x509_certificate((made.folder / "page.pem").read_bytes())
    names = page.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert "robot.example" in names.get_values_for_type(x509.DNSName)
    assert "127.0.0.1" in map(str, names.get_values_for_type(x509.IPAddress))


def test_members_come_go_and_are_renewed(tmp_path: Path) -> None:
    made = SecurityFolder.create(tmp_path / "keys", days=30)
    file = made.add("anna", "watch")
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    for name, role, said in (("anna", "watch", "there already"), ("router", "watch", "already"),
                             ("ben", "king", "no role 'king'")):  # fmt: skip
        with pytest.raises(SettingsError, match=said):
            made.add(name, role)
    made.add("detector-2", "detector")
    assert {"anna", "detector-2"} <= subjects(made)
    old = made.file_of("tracker").read_bytes()
    made.renew()
    assert made.file_of("tracker").read_bytes() != old
    made.remove("anna")
    assert "anna" not in subjects(made)
    assert not file.exists()
    with pytest.raises(SettingsError, match="no 'anna'"):
        made.remove("anna")
    kept = SecurityFolder(made.folder)
    assert kept.members == made.members
    _, first = next(iter(kept.ends()))
    left = first - datetime.datetime.now(datetime.UTC)
    assert datetime.timedelta(days=29) < left <= datetime.timedelta(days=30)


def test_with_passwords_each_member_is_a_user_and_those_removed_are_none(tmp_path: Path) -> None:
    made = SecurityFolder.create(tmp_path / "keys", by="password")
    made.add("anna", "watch")
    made.remove("operator")
    lines = (made.folder / "bus-users").read_text().splitlines()
    assert {line.partition(":")[0] for line in lines} == {*SERVICES, "anna"}
    assert all(len(line.partition(":")[2]) >= 32 for line in lines)
    router = RouterSettings(config_file=made.file_of("router"))
    assert router.listen == ("tcp/0.0.0.0:7447",)
    router_config(router)


def test_a_folder_that_is_none_is_said_to_be_none(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="heel security init"):
        SecurityFolder(tmp_path)
    (tmp_path / "members.json").write_text("{}")
    with pytest.raises(SettingsError, match="make another folder"):
        SecurityFolder(tmp_path)
