"""Whether every dependency has a wheel for 64-bit ARM: the tables of docs/records/wheels.md.

`pip` resolves what `pyproject.toml` asks for, within `constraints.txt`, on the package index that
it is set up for, as a Raspberry Pi OS of 64 bits would, and installs nothing. A package without a
wheel would be compiled on the robot, for hours, or fail.

Example run: python -m tools.wheels --write docs/records/wheels.md
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import typer

from benchmarks.common import Write, publish
from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app
from tools.site import REPOSITORY

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
PYTHONS = ("3.11", "3.12", "3.13")
EXTRAS = ("neural", "sim", "eval")
PLATFORMS = (
    *(f"manylinux_2_{minor}_aarch64" for minor in (31, 28, 27, 26, 24, 17)),
    "manylinux2014_aarch64",
)
"""glibc 2.31 and older: Raspberry Pi OS 11 and newer, Ubuntu 20.04 and newer, Jetson Linux 35."""
_TIMEOUT_S = 600.0
"""For one version of Python, on a slow index; chosen by hand."""


def wheels(python: str) -> dict[str, str]:
    """File name of the wheel of each package, for one version of Python.

    Raises:
        HeelError: a package has none, or the index does not answer.
    """
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = list(project["dependencies"])
    for extra in EXTRAS:
        wanted += project["optional-dependencies"][extra]
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        words = [
            sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
            "--dry-run", "--ignore-installed", "--target", folder, "--only-binary=:all:",
            "--implementation", "cp", "--python-version", python,
            *(word for tag in PLATFORMS for word in ("--platform", tag)),
            "--constraint", str(REPOSITORY / "constraints.txt"), "--report", str(report), *wanted,
        ]  # fmt: skip
        done = subprocess.run(
            words, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False
        )
        if done.returncode:
            last = done.stderr.strip().splitlines()[-1:] or ["pip said nothing"]
            raise HeelError(f"Python {python} on aarch64: {last[0]}")
        installed = json.loads(report.read_text(encoding="utf-8"))["install"]
    return {
        one["metadata"]["name"]: one["download_info"]["url"].rpartition("/")[2]
        for one in installed
    }  # fmt: skip


def table(found: dict[str, dict[str, str]]) -> str:
    """Markdown: compiled packages by version of Python; the others are the same everywhere."""
    names = sorted({name for one in found.values() for name in one}, key=str.lower)
    lines = ["| package | version | " + " | ".join(found) + " |", "|---|---|" + "---|" * len(found)]
    plain = []
    for name in names:
        files = [one.get(name, "") for one in found.values()]
        if all(file.endswith("-any.whl") for file in files):
            plain.append(name)
            continue
        version = next(file for file in files if file).split("-")[1]
        lines.append(f"| {name} | {version} | " + " | ".join(map(_tags, files)) + " |")
    return "\n".join(lines) + f"\n\nPure Python, the same everywhere: {', '.join(plain)}.\n"


def _tags(file: str) -> str:
    """Interpreter and oldest glibc of a wheel."""
    if not file:
        return "not needed"
    interpreter, abi, platform = file.removesuffix(".whl").split("-")[-3:]
    kind = f"{interpreter} {abi}" if abi == "abi3" else interpreter
    return f"{kind}, {platform.split('.')[0].removesuffix('_aarch64')}"


@app.command()
def main(write: Write = None) -> None:
    """Resolve all dependencies for 64-bit ARM; ends with 1 where a wheel is missing."""
    publish(table({f"Python {python}": wheels(python) for python in PYTHONS}), write)


if __name__ == "__main__":
    run_app(app)
