"""The units that `heel systemd` writes, as systemd reads them."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest
from typer.testing import CliRunner

from heel.schemas.errors import SettingsError
from heel.services.cli import app
from heel.services.commands.systemd import RULES, STACK, TARGET, Layout, quoted, rules, units

PROGRAM = ("/bin/true",)


def parsed(unit: str) -> dict[str, list[str]]:
    """`Section.Name` to its values, in order."""
    found: dict[str, list[str]] = defaultdict(list)
    section = ""
    for line in unit.splitlines():
        if header := re.fullmatch(r"\[(\w+)\]", line):
            section = header[1]
        elif line and not line.startswith("#"):
            name, equals, value = line.partition("=")
            assert equals, line
            found[f"{section}.{name}"].append(value)
    return found


@pytest.mark.parametrize("user", [False, True])
def test_every_service_is_watched_and_started_again_but_not_for_ever(user: bool) -> None:
    files = units(Layout(PROGRAM, user=user))
    for service in ("router", *STACK):
        unit = parsed(files[f"heel-{service}.service"])
        assert unit["Service.Type"] == ["notify"]
        assert unit["Service.ExecStart"] == [f"/bin/true {service}"]
        assert 1 < int(unit["Service.WatchdogSec"][0]) <= 2, "frozen to running within 5 s"
        assert float(unit["Service.RestartSec"][0]) <= 0.5
        assert unit["Service.Restart"] == ["on-failure"]
        assert unit["Service.RestartPreventExitStatus"] == ["2"]
        assert unit["Unit.StartLimitBurst"] == ["5"]
        assert unit["Service.NoNewPrivileges"] == ["yes"]
        assert unit["Unit.PartOf"] == [TARGET]
        assert "HEEL_STATE_DIR=%S/heel" in " ".join(unit["Service.Environment"])
        assert unit["Service.StateDirectory"] == ["heel"]
        after = [] if service == "router" else ["heel-router.service"]
        assert unit["Unit.After"] == unit["Unit.Wants"] == after
    target = parsed(files[TARGET])
    assert target["Unit.Wants"][0].split() == [f"heel-{one}.service" for one in ("router", *STACK)]
    assert target["Install.WantedBy"] == ["default.target" if user else "multi-user.target"]


def test_the_machines_services_have_an_account_and_no_devices_but_their_own() -> None:
    files = units(Layout(PROGRAM, account="robot"))
    assert files["heel-sysusers.conf"].startswith("u robot ")
    for service in ("router", *STACK):
        unit = parsed(files[f"heel-{service}.service"])
        assert unit["Service.User"] == ["robot"]
        assert unit["Service.ProtectSystem"] == ["strict"]
        assert unit["Service.CapabilityBoundingSet"] == [""]
        opens = service in ("capture", "drive")
        assert ("Service.PrivateDevices" in unit) is not opens
        assert ("Service.SupplementaryGroups" in unit) is opens
        # Else each stop of a service would take the folder from the others.
        assert unit["Service.RuntimeDirectoryPreserve"] == ["yes"]


def test_a_users_units_ask_for_nothing_that_takes_root() -> None:
    for name, unit in units(Layout(PROGRAM, user=True)).items():
        assert not {"Service.User", "Service.ProtectSystem", "Service.OOMScoreAdjust"} & set(
            parsed(unit)
        ), name


def test_a_stack_and_settings_of_ones_own(tmp_path: Path) -> None:
    config = tmp_path / "far away.toml"
    config.write_text(
        '[robot]\nstack = ["detector"]\n[zenoh]\nconnect = ["tcp/192.168.1.7:7447"]\n'
    )
    out = tmp_path / "units"
    asked = ["systemd", str(out), "--config", str(config), "--udev"]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    names = {"heel-detector.service", TARGET, "heel-sysusers.conf", RULES}
    assert {file.name for file in out.iterdir()} == names, "no router: it is on the robot"
    unit = parsed((out / "heel-detector.service").read_text())
    assert unit["Service.ExecStart"][0].endswith(f'heel detector --config "{config}"')
    assert "Unit.Wants" not in unit
    assert "SYSTEMD_WANTS" not in (out / RULES).read_text(), "no capture and no drive here"


def test_what_is_no_service_is_refused_by_name(tmp_path: Path) -> None:
    config = tmp_path / "robot.toml"
    config.write_text('[robot]\nstack = ["arm"]\n')
    done = CliRunner().invoke(app, ["systemd", str(tmp_path), "--config", str(config)])
    assert isinstance(done.exception, SettingsError)
    assert "robot.stack: arm" in str(done.exception)
    without = CliRunner().invoke(app, ["systemd"])
    assert "--user" in str(without.exception)


def test_the_users_own_units_are_where_systemd_looks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert CliRunner().invoke(app, ["systemd", "--user"]).exit_code == 0
    assert (tmp_path / "systemd" / "user" / TARGET).is_file()


@pytest.mark.parametrize(
    ("word", "written"),
    [("plain", "plain"), ("a b", '"a b"'), ("50%", "50%%"), ("$HOME", "$$HOME"),
     ('say "no"', '"say \\"no\\""'), ("back\\slash", "back\\\\slash")],
)  # fmt: skip
def test_nothing_in_a_path_is_expanded(word: str, written: str) -> None:
    assert quoted(word) == written


def test_a_path_with_a_new_line_is_refused() -> None:
    with pytest.raises(SettingsError):
        quoted("a\nExecStart=/bin/sh")


@pytest.mark.parametrize("user", [False, True])
def test_the_rules_are_udevs_grammar(user: bool) -> None:
    text = rules(Layout(PROGRAM, user=user))
    for line in filter(None, text.splitlines()):
        if not line.startswith("#"):
            for part in line.split(", "):
                assert re.fullmatch(r'[A-Z]+(\{[\w./]+\})?(==|\+=|=)"[^"{}]*"', part), part
    wants = "SYSTEMD_USER_WANTS" if user else "SYSTEMD_WANTS"
    assert f'ENV{{{wants}}}+="heel-capture.service"' in text
    assert f'ENV{{{wants}}}+="heel-drive.service"' in text
    assert 'ENV{ID_MM_PORT_IGNORE}="1"' in text


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd here")
def test_systemd_finds_nothing_to_complain_of(tmp_path: Path) -> None:
    for name, unit in units(Layout(PROGRAM, config=Path("/etc/a b.toml"))).items():
        (tmp_path / name).write_text(unit)
    checked = [str(file) for file in tmp_path.iterdir() if file.suffix != ".conf"]
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", *checked], capture_output=True, text=True,
        timeout=30, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
