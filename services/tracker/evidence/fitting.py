"""Joint fit of all people to the evidence: coordinate ascent, nearest person first."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from heel.services.geometry.boxes import cover, intersection_matrix
from heel.services.tracker.evidence.arrays import Foot, box_at
from heel.services.tracker.evidence.canvas import Canvas, Fit, Window
from heel.services.tracker.evidence.coverage import Standing, reduce, reduction, standing
from heel.services.tracker.evidence.samples import Sample
from heel.services.tracker.evidence.scale import SceneScale
from heel.services.tracker.evidence.silhouette import Silhouette

_MORE_SWEEPS = 1
"""Sweeps of the coordinate ascent after the first, over people whose windows meet; more cost time.
Chosen by hand."""
_PENALTY = 0.0075
"""Gain that one squared deviation from the prediction costs: it decides between places that the
evidence hardly tells apart; chosen by hand."""
_DEVIATION = 0.06
"""Heights: standard deviation of the predicted foot point; chosen by hand."""
_REACH = 0.12
"""Heights: half size of the search window, two deviations of the prediction; chosen by hand."""
_REACH_GROWTH = 1.1
"""Factor on the window with each frame missed, as the prediction grows unsure; chosen by hand."""
_REACH_LIMIT = 2.0
"""Most that the window grows, as a factor: a larger one reaches other people; chosen by hand."""
_FACTORS = (0.88, 0.94, 1.0, 1.06, 1.12)
"""Heights tried at a measurement of the height, as factors on the one known: to either side two
deviations of people around a scene's line, in steps of one; chosen by hand."""
_MOST_BIRTHS = 6
"""New people of one frame at most, which bounds its time: more are born in the next; chosen by
hand."""
_FREE = 1e6
"""Working pixels: deviation of a prediction that says nothing."""


def fit_people(canvas: Canvas, people: Sequence[Silhouette], ratio: float) -> dict[int, Fit]:
    """Best position of each person given all others; leaves their templates on the canvas.

    Returns:
        Fit by person id; people whose window leaves the canvas are missing from it.
    """
    order = sorted(people, key=lambda person: (-person.foot[1], person.id))
    feet = {person.id: person.foot for person in order}
    for person in order:
        canvas.add(canvas.template(person.height), feet[person.id])
    fits: dict[int, Fit] = {}
    # A person apart from all others finds the same place again: one sweep does.
    for sweep in (order, *[_touching(order, ratio)] * _MORE_SWEEPS):
        for person in sweep:
            shape = canvas.template(person.height)
            canvas.add(shape, feet[person.id], -1.0)
            fit = _fit_one(canvas, person)
            if fit is not None:
                feet[person.id] = fit.foot
                fits[person.id] = fit
            canvas.add(shape, feet[person.id])
    return fits


def _reach(person: Silhouette) -> int:
    growth = min(_REACH_GROWTH**person.missed_frames, _REACH_LIMIT)
    return max(2, round(_REACH * person.height * growth))


def _touching(people: Sequence[Silhouette], ratio: float) -> list[Silhouette]:
    """People whose search area meets that of another one."""
    areas = np.empty((len(people), 4))
    for index, person in enumerate(people):
        (x, y), height, reach = person.foot, person.height, 2.0 * _reach(person) + 2.0
        half = 0.8 * ratio * height + reach
        areas[index] = x - half, y - 1.05 * height - reach, x + half, y + 0.05 * height + reach
    meetings = (intersection_matrix(areas, areas) > 0.0).sum(axis=1)  # each area meets itself
    return [person for person, count in zip(people, meetings, strict=True) if count > 1]


def _fit_one(canvas: Canvas, person: Silhouette) -> Fit | None:
    reach = _reach(person)
    window = Window(person.foot, (reach, reach), _DEVIATION * person.height, _PENALTY)
    return canvas.search(canvas.template(person.height), window)


def shares_in_view(
    canvas: Canvas, people: Sequence[Silhouette], fits: dict[int, Fit]
) -> dict[int, float]:
    """Share of each person's silhouette that no nearer person covers (lower feet are nearer)."""
    feet = {person.id: _placed(person, fits) for person in people}
    order = sorted(people, key=lambda person: (-feet[person.id][1], person.id))
    return {
        person.id: canvas.in_view(canvas.template(person.height), feet[person.id])
        for person in order
    }


def _placed(person: Silhouette, fits: dict[int, Fit]) -> Foot:
    return fits[person.id].foot if person.id in fits else person.foot


def measure_height(canvas: Canvas, person: Silhouette, fit: Fit) -> tuple[float, float] | None:
    """Height and foot row that explain most, for a person seen in the open.

    Returns:
        Height and foot row in working pixels, or None when the window leaves the canvas.
    """
    own = canvas.template(person.height)
    canvas.add(own, fit.foot, -1.0)
    window = Window(fit.foot, (1, max(2, round(0.06 * person.height))), _FREE)
    crop = canvas.crop(canvas.template(person.height * max(_FACTORS)), window)
    canvas.add(own, fit.foot)
    if crop is None:
        return None
    best, height = Fit(fit.foot, 0.0, -math.inf), person.height
    for factor in _FACTORS:
        found = canvas.search(canvas.template(person.height * factor), window, crop)
        if found is not None and found.total > best.total:
            best, height = found, person.height * factor
    return height, best.foot[1]


def births(
    canvas: Canvas,
    people: Sequence[Silhouette],
    scale: SceneScale,
    smallest: float,
    threshold: float,
) -> list[tuple[Fit, float]]:
    """New people on what is left unexplained, where the scene's height line is known.

    Args:
        canvas: with all people placed; those missed are taken off it.
        people: all that are known.
        scale: of the scene.
        smallest: lowest person, working pixels.
        threshold: least gain of a new person.

    Returns:
        Fit and height of each, most explained first.
    """
    _lift_missed(canvas, people)
    seen = [person for person in people if person.missed_frames == 0]
    rest = canvas.evidence[canvas.inner] * canvas.unexplained(*canvas.inner)
    more = reduction(scale.typical / canvas.step)
    step = more * canvas.step
    reduced = reduce(rest, canvas.absent[canvas.inner], more)
    found: list[tuple[Fit, float]] = []
    for candidate in standing(reduced, step, scale, smallest, threshold)[:_MOST_BIRTHS]:
        if _behind(candidate, seen, scale.ratio) > 0.5:
            continue
        shape = canvas.template(candidate.height)
        fit = canvas.search(shape, Window(candidate.foot, (step + 1, step + 1), _FREE))
        if fit is not None and fit.gain > threshold:
            found.append((fit, candidate.height))
            canvas.add(shape, fit.foot)
    return found


def births_without_scale(
    canvas: Canvas, people: Sequence[Silhouette], samples: Sequence[Sample], threshold: float
) -> list[tuple[Fit, float]]:
    """New people in clean components, each of its component's height; see `births`.

    Components of all evidence are used: those of what is left unexplained give more people and far
    more ghosts.
    """
    _lift_missed(canvas, people)
    found: list[tuple[Fit, float]] = []
    for sample in samples[:_MOST_BIRTHS]:
        shape = canvas.template(sample.height)
        fit = canvas.search(shape, Window(sample.foot, (2, 2), _FREE))
        if fit is not None and fit.gain > threshold:
            found.append((fit, sample.height))
            canvas.add(shape, fit.foot)
    return found


def _lift_missed(canvas: Canvas, people: Sequence[Silhouette]) -> None:
    """Take people that are not seen off the canvas: they explain nothing."""
    for person in people:
        if person.missed_frames > 0:
            canvas.add(canvas.template(person.height), person.fitted_foot, -1.0)


def _behind(candidate: Standing, people: Sequence[Silhouette], ratio: float) -> float:
    """Share of a candidate's box behind the nearer person that covers most of it."""
    box = box_at(candidate.foot, candidate.height, ratio)
    nearer = [person for person in people if person.foot[1] > candidate.foot[1]]
    return max((cover(box, person.box(ratio)) for person in nearer), default=0.0)
