"""A lens from pictures of a board: drawn through a known lens, found again, and refused."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from typer.testing import CliRunner

from heel.schemas import HeelError
from heel.services.cli import app
from heel.services.geometry.board import CharucoBoard, Checkerboard, View, Views, estimate_lens
from heel.services.geometry.camera import Pinhole
from heel.services.geometry.lens import Lens
from heel.services.geometry.lens_file import read_lens

SIZE = (640, 480)
SQUARE_M = 0.03
BOARD = Checkerboard(7, 5, SQUARE_M)
FISHEYE = Lens(True, (240.0, 241.0), (322.0, 238.0), (-0.02, 0.004, -0.001, 0.0002))
BARREL = Lens(False, (400.0, 401.0), (322.0, 238.0), (-0.2, 0.04, 0.0005, -0.0005, 0.0))
LENSES = pytest.mark.parametrize("lens", [FISHEYE, BARREL], ids=["fisheye", "barrel"])


def poses(count: int = 30, seed: int = 3) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Rotations and translations of boards before the camera, all over the picture."""
    random = np.random.default_rng(seed)
    found = []
    for index in range(count):
        across, down = (index % 5 - 2) / 2, (index // 5 % 3 - 1)
        depth = random.uniform(0.25, 0.4)
        turn = cv2.Rodrigues(random.uniform(-0.5, 0.5, 3))[0]
        away = np.array([0.62 * across * depth, 0.42 * down * depth, depth])
        found.append((np.asarray(turn, np.float64), away - turn @ [0.12, 0.09, 0.0]))
    return found


def corners(lens: Lens, noise_px: float = 0.1) -> Views:
    """Views of the whole board through a lens, without pictures."""
    random, views = np.random.default_rng(1), Views(SIZE)
    places = np.zeros((35, 3))
    places[:, :2] = np.mgrid[1:8, 1:6].T.reshape(-1, 2) * SQUARE_M
    for turn, away in poses():
        deep = places @ turn.T + away
        pixels = lens.pixels(deep[:, :2] / deep[:, 2:]) + random.normal(0, noise_px, (35, 2))
        if (pixels > 0).all() and (pixels < SIZE).all():
            views.add(View(places, pixels))
    return views


def picture(lens: Lens, turn: NDArray[np.float64], away: NDArray[np.float64],
            plan: NDArray[np.uint8], metres: tuple[float, float]) -> NDArray[np.uint8]:  # fmt: skip
    """What a camera sees of a drawing of that size that lies on the board's plane."""
    v, u = np.mgrid[: SIZE[1], : SIZE[0]]
    rays = lens.rays(np.stack([u, v], axis=-1).astype(np.float64))
    deep = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1)
    scale = (turn[:, 2] @ away) / (deep @ turn[:, 2])
    on_board = (deep * scale[..., None] - away) @ turn
    at = on_board[..., :2] / metres * (plan.shape[1], plan.shape[0])
    seen = cv2.remap(plan, at.astype(np.float32), None, cv2.INTER_AREA, borderValue=255)
    return np.asarray(cv2.GaussianBlur(seen, (0, 0), 0.7), np.uint8)


def checkerboard(cell_px: int = 40) -> NDArray[np.uint8]:
    """8 x 6 squares with a white rim, and so 7 x 5 inner corners."""
    squares = (np.indices((6, 8)).sum(axis=0) % 2 * 255).astype(np.uint8)
    return np.pad(squares.repeat(cell_px, 0).repeat(cell_px, 1), cell_px, constant_values=255)


@LENSES
def test_a_lens_is_found_again(lens: Lens) -> None:
    estimate = estimate_lens(corners(lens), lens.fisheye)
    assert estimate.residual_px < 0.2
    assert estimate.covered >= 0.75
    truth, found = Pinhole.through(lens, *SIZE), Pinhole.through(estimate.found.lens, *SIZE)
    for u_px in (5.0, 100.0, 320.0, 500.0, 635.0):
        for v_px in (50.0, 240.0, 430.0):
            want = truth.bearing_rad(u_px, v_px)
            if abs(want) > math.radians(60):
                continue
            assert found.bearing_rad(u_px, v_px) == pytest.approx(want, abs=0.009)  # half a degree


def test_from_pictures_to_a_file_that_capture_reads(tmp_path: Path) -> None:
    drawing = checkerboard()
    folder = tmp_path / "board"
    folder.mkdir()
    for index, (turn, away) in enumerate(poses(22)):
        seen = picture(BARREL, turn, away, drawing, (10 * SQUARE_M, 8 * SQUARE_M))
        cv2.imwrite(str(folder / f"{index:03}.png"), seen)
    out = tmp_path / "lens.yaml"
    command = ["calibrate", "board", str(folder), "--board", "7x5", "--square-mm", "30",
               "--out", str(out)]  # fmt: skip
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert f"heel capture --lens {out}" in result.output
    found = read_lens(out).lens
    assert found.focal_px == pytest.approx(BARREL.focal_px, rel=0.03)


def test_a_part_of_a_charuco_board_is_enough() -> None:
    board = CharucoBoard(8, 6, SQUARE_M, 0.022, "5X5_100")
    plan = np.asarray(board._board.generateImage((640, 480)), np.uint8)
    turn, away = np.eye(3), np.array([0.03, -0.09, 0.25])
    view = board.find(picture(BARREL, turn, away, plan, (8 * SQUARE_M, 6 * SQUARE_M)))
    assert view is not None
    assert 8 <= len(view.places) < 35
    want = BARREL.pixels((view.places + away)[:, :2] / away[2])
    assert np.abs(view.pixels - want).max() < 1.5


def test_too_few_views_and_a_bare_corner_are_refused_with_what_to_do() -> None:
    views = corners(BARREL)
    few = Views(SIZE)
    few.chosen = views.chosen[:3]
    with pytest.raises(HeelError, match="found in 3 places, 8 are wanted"):
        estimate_lens(few, fisheye=False)
    left = Views(SIZE)
    left.chosen = [View(v.places, v.pixels * (0.5, 1)) for v in views.chosen]
    with pytest.raises(HeelError, match=r"show it in the (upper|lower) right"):
        estimate_lens(left, fisheye=False)


def test_corners_that_do_not_fit_are_refused() -> None:
    views = corners(BARREL, noise_px=6.0)
    with pytest.raises(HeelError, match=r"corners are .* px off: hold the board still"):
        estimate_lens(views, fisheye=False)


def test_a_view_that_is_there_already_is_not_kept() -> None:
    views, first = Views(SIZE), corners(BARREL).chosen[0]
    assert views.add(first)
    assert not views.add(View(first.places, first.pixels + 3.0))


@pytest.mark.parametrize(
    ("dictionary", "marker_m", "words"),
    [("7X", 0.02, "no dictionary 7X"), ("4X4_50", 0.04, "smaller fit")],
)
def test_a_board_that_cannot_be_is_refused(dictionary: str, marker_m: float, words: str) -> None:
    with pytest.raises(HeelError, match=words):
        CharucoBoard(8, 6, SQUARE_M, marker_m, dictionary)
