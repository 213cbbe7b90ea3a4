"""What a release consists of: wheel, source archive, image, and their checksums.

Nothing is published. The same commit gives the same wheel and source archive, byte for byte.

Example run: python -m tools.release --out dist
"""

from __future__ import annotations

import gzip
import hashlib
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Annotated, Literal

import typer

from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app
from tools.site import REPOSITORY

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
SUMS = "SHA256SUMS"
_BUILD_S = 1800.0
"""Longest build of an image [s], another kind of computer's emulated; chosen by hand."""
_CHUNK = 1 << 20  # bytes read at once; chosen by hand


@app.command()
def release(
    out: Annotated[Path, typer.Option(help="folder for the files; emptied first")] = Path("dist"),
    image: Annotated[
        Literal["here", "all", "none"],
        typer.Option(help="for this kind of computer, for all (emulated), or no image"),
    ] = "here",
) -> None:
    """Build everything into one folder and list it with sizes."""
    version = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]["version"]
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    _run([sys.executable, "-m", "hatchling", "build", "-d", str(out.absolute())])
    if image == "here":
        _save_image(version, out)
    elif image == "all":
        archive = out.absolute() / f"heel-follow-{version}-image-oci.tar"
        _run(["docker", "buildx", "bake", "-f", "docker-bake.hcl", "all",
              "--set", f"all.output=type=oci,dest={archive}"])  # fmt: skip
    files = sorted(out.iterdir())
    sums = [f"{_sha256(file)}  {file.name}\n" for file in files]
    (out / SUMS).write_text("".join(sums), encoding="utf-8")
    for file in files:
        typer.echo(f"{file.stat().st_size / 1e6:8.1f} MB  {file}")
    typer.echo(f"checked with: cd {out} && sha256sum --check {SUMS}")


def _save_image(version: str, out: Path) -> None:
    tag = f"heel-follow:{version}"
    _run(["docker", "buildx", "bake", "-f", "docker-bake.hcl", "--set", f"here.tags={tag}"])
    kind = _run(["docker", "image", "inspect", "--format", "{{.Architecture}}", tag]).strip()
    file = out / f"heel-follow-{version}-image-{kind}.tar.gz"
    with subprocess.Popen(["docker", "save", tag], stdout=subprocess.PIPE) as saved:
        assert saved.stdout is not None
        # Level 1: half the time of 6 for 5 % more bytes. No time of day in the file.
        with file.open("wb") as raw, gzip.GzipFile("", "wb", 1, raw, mtime=0) as packed:
            shutil.copyfileobj(saved.stdout, packed, _CHUNK)
    if saved.returncode:
        raise HeelError(f"docker save {tag}: exit code {saved.returncode}")


def _sha256(file: Path) -> str:
    with file.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _run(command: list[str]) -> str:
    """Standard output of a command that has to succeed.

    Raises:
        HeelError: it failed, or the program is missing.
    """
    try:
        done = subprocess.run(
            command, cwd=REPOSITORY, env=_environment(), capture_output=True, text=True,
            timeout=_BUILD_S, check=False,
        )  # fmt: skip
    except OSError as error:
        raise HeelError(f"{command[0]}: {error.strerror}: --image none does without") from None
    if done.returncode:
        raise HeelError(f"{' '.join(command)}: {done.stderr.strip()[-600:]}")
    return done.stdout


def _environment() -> dict[str, str]:
    """With the time of the commit as that of all files in the archives."""
    asked = ["git", "log", "-1", "--format=%ct"]
    done = subprocess.run(asked, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    known = {"SOURCE_DATE_EPOCH": done.stdout.strip()} if done.returncode == 0 else {}
    return known | dict(os.environ)


if __name__ == "__main__":
    run_app(app)
