"""The file that a container's health check reads."""

from __future__ import annotations

from pathlib import Path

from heel.services.runtime.health_file import HealthFile


def test_the_last_word_replaces_the_one_before(tmp_path: Path) -> None:
    path = tmp_path / "health"
    file = HealthFile(path)
    assert file.write("starting", "") is None
    assert file.write("degraded", "camera silent") is None
    assert path.read_text(encoding="utf-8") == "degraded camera silent\n"
    assert list(tmp_path.iterdir()) == [path]


def test_a_file_that_cannot_be_written_is_told_of_once_and_again_after_it_could(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "later"
    file = HealthFile(folder / "health")
    complaint = file.write("ok", "")
    assert complaint is not None
    assert str(folder / "health") in complaint
    assert "--health-file" in complaint
    assert file.write("ok", "") is None
    folder.mkdir()
    assert file.write("ok", "") is None
    (folder / "health").unlink()
    folder.rmdir()
    assert file.write("ok", "") == complaint


def test_a_link_in_the_way_is_not_followed(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.write_text("precious\n")
    (tmp_path / "health.new").symlink_to(victim)
    assert HealthFile(tmp_path / "health").write("ok", "") is None
    assert victim.read_text() == "precious\n"
    assert (tmp_path / "health").read_text() == "ok \n"
