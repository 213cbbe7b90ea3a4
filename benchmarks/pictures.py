"""The documentation's picture: the page while a robot follows somebody through a simulated world.

Needs Chromium and its driver. Example run: python -m benchmarks.pictures docs
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import cv2
import numpy as np
import typer

from benchmarks.common import NAMED_NETWORKS, wait_for
from heel.schemas.errors import HeelError
from heel.services.runtime.command_line import run_app

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
_SIZE_PX = "1560,900"
_DEADLINE_S = 60.0
_JPEG_QUALITY = 86


@app.command()
def main(
    folder: Annotated[Path, typer.Argument(help="where the picture goes")],
    after_s: Annotated[float, typer.Option(help="simulated seconds into the episode")] = 15.0,
) -> None:
    """Run `heel demo`, look at its page, and keep the picture of a moment."""
    with _demo() as url, _browser() as driver:
        driver.get(url)
        moment = "return Number(document.getElementById('map').dataset.time ?? 0)"
        wait_for(
        lambda: driver.execute_script(moment) >= after_s, _DEADLINE_S,
        f"{after_s:g} s of simulated time did not come: run heel demo alone,",
    )  # fmt: skip
        png = driver.get_screenshot_as_png()
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    path = folder / "demo.jpg"
    if picture is None or not cv2.imwrite(
        str(path), picture, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    ):
        raise HeelError(f"{path} cannot be written: give a folder that exists")
    typer.echo(f"wrote {path}")


@contextmanager
def _demo() -> Iterator[str]:
    """The demo's page while it runs."""
    with tempfile.TemporaryDirectory() as out:
        command = [sys.executable, "-m", "heel", "demo", "--port", "0", "--out", out]
        log = Path(out) / "stdout"
        with log.open("wb") as stream:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=stream, env=os.environ | NAMED_NETWORKS
            )
        try:
            page = re.compile(r"live page: (\S+)")
            found = wait_for(
                lambda: page.findall(log.read_text()), _DEADLINE_S, "the demo's page did not come"
            )
            yield found[0]
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(timeout=20)


@contextmanager
def _browser() -> Iterator[Chrome]:
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    chromium, chromedriver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or chromedriver is None:
        raise HeelError("the picture needs a browser: install chromium and chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", f"--window-size={_SIZE_PX}"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options, Service(chromedriver))
    try:
        yield driver
    finally:
        driver.quit()


if __name__ == "__main__":
    run_app(app)
