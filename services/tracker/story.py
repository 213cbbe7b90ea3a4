"""A trace told in sentences: what became of an id, why, and what else it might have been."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from heel.services.tracker.trace import Event, Kind

AROUND_FRAMES = 50
"""Frames before and after the one asked about whose events are told: two to five seconds, the
length of an encounter; chosen by hand."""
_UNLIKELY = 0.0005
"""Probability below which a runner-up is not told: what is rounded to nothing; chosen by hand."""

_INPUTS = {
    "foreground": "the detector sends regions that differ from the background",
    "people": "the detector sends people's boxes",
    "pointed-at": "the detector looks for the person that was pointed at",
}
_METHODS = {
    "evidence": "silhouettes are fitted to them, and colours decide which person is which",
    "paper": "the published method tracks them",
    "boxes": "motion and colours decide which person is which",
    "pointed-at": "the id stays on whatever it finds, and the detector's score is the confidence",
}
_CAUSES = {
    "confidence": "too little confidence was left in it",
    "return": "the box after the gap was too probably another track's",
    "contact": "after the contact nobody could say which person it is",
    "newcomer": "a newcomer came forth from the same box, and fits the id better",
}


def ids_of(events: Sequence[Event]) -> set[int]:
    """All ids that occur."""
    return {key for event in events for key in (event.id, event.other, event.runner_up) if key}


def about(event: Event, track_id: int) -> bool:
    """Whether an event belongs to the story of an id; which input there is does to any."""
    if event.kind in ("input", "full"):
        return True
    hides_another = event.kind == "unseen" and track_id != event.id
    return track_id in (event.id, event.other) and not hides_another


def told(
    events: Sequence[Event], track_id: int | None = None, frame: int | None = None
) -> list[str]:
    """Sentences, in time order; arguments as of `story`."""
    return [
        f"frame {one.frame} ({one.t_s:.2f} s): {sentence(one)}."
        for one in story(events, track_id, frame)
    ]


def story(
    events: Sequence[Event], track_id: int | None = None, frame: int | None = None
) -> list[Event]:
    """The events that are told.

    Args:
        events: of a trace, as written.
        track_id: whose story; None for everybody's.
        frame: tell the events near this one alone, and the last one before them.
    """
    chosen = [event for event in events if track_id is None or about(event, track_id)]
    if frame is not None:
        before = [event for event in chosen if event.frame < frame - AROUND_FRAMES]
        near = [event for event in chosen if abs(event.frame - frame) <= AROUND_FRAMES]
        chosen = before[-1:] + near
    return chosen


def sentence(event: Event) -> str:
    """One event in words, without its frame, its time and a full stop."""
    return _SENTENCES[event.kind](event)


def _input(event: Event) -> str:
    return f"{_INPUTS[event.input or 'foreground']}; {_METHODS[event.method or 'evidence']}"


def _unseen(event: Event) -> str:
    why = f"hidden by id {event.other}" if event.other else "and nothing known hides it"
    return f"id {event.id} is not seen on its own any more, {why}"


def _unsure(event: Event) -> str:
    return (
        f"id {event.id} is unsure: {percent(event.probability)} that it is on the same person"
        f"{_rest(event)}"
    )


def _sure(event: Event) -> str:
    return f"id {event.id} is sure again: {percent(event.probability)}{_rest(event)}"


def _decided(event: Event) -> str:
    pair = f"the contact of ids {event.id} and {event.other}"
    clues = (
        f"motion alone says {_chance(event.motion_log_odds)} that both stayed, colours alone "
        f"{_chance(event.looks_log_odds)}"
    )
    if event.outcome == "exchanged":
        return (
            f"{pair} is decided: the tracks had changed people, with {percent(event.probability)}, "
            f"so the ids were exchanged back ({clues})"
        )
    if event.outcome == "kept":
        return (
            f"{pair} is decided: each stayed with its person, with {percent(event.probability)} "
            f"({clues})"
        )
    return (
        f"{pair} ends undecided: each is left where it is, with {percent(event.probability)} "
        f"({clues})"
    )


def _assigned(event: Event) -> str:
    after = "after the contact "
    if event.outcome == "kept":
        what = f"id {event.id} is decided to be on its own person"
    else:
        what = f"the track that was id {event.id} is decided to be the person of id {event.other}"
    return f"{after}{what}, with {percent(event.probability)}{_rest(event)}"


def _returned(event: Event) -> str:
    return (
        f"id {event.id} has a box again after a gap: {percent(event.probability)} that it is the "
        f"same person{_rest(event)}"
    )


def _re_identified(event: Event) -> str:
    who = f"the track that was id {event.other}" if event.other else "a new track"
    return (
        f"{who} is taken for the person of id {event.id} that was out of sight, with "
        f"{percent(event.probability)}{_rest(event, unknown='a new person')}"
    )


def _new(event: Event) -> str:
    own = f"id {event.id} is compared with people out of sight, and stays a person of its own"
    if not event.runner_up or (event.runner_up_probability or 0.0) < _UNLIKELY:
        return f"{own}: none of them is likely"
    best = f"the likeliest of them is id {event.runner_up} with"
    return f"{own}: {best} {percent(event.runner_up_probability)}, which is too little"


def _given_up(event: Event) -> str:
    return (
        f"id {event.id} is given up ({percent(event.probability)} left), as "
        f"{_CAUSES[event.cause or 'confidence']}; the track goes on as id {event.other}"
        f"{_rest(event)}"
    )


def _verifying(event: Event) -> str:
    return (
        f"{_newcomer(event)} came forth from the box of id {event.id}: until both are seen alone "
        "it is open on which of them the id is"
    )


def _verified(event: Event) -> str:
    clues = (
        f"colours of before say {_chance(event.before_log_odds)} that it stayed, colours of the "
        f"split {_chance(event.split_log_odds)}"
    )
    against = f"id {event.id} against {_newcomer(event)}"
    left = f"{percent(event.probability)} is left, doubts of before included"
    if event.before_log_odds is None:
        return f"{against}: that one is gone before both were seen alone; {left}"
    found = {"confirmed": "confirmed", "refuted": "refuted"}.get(event.outcome or "open")
    return f"{against}: {found or 'colours cannot tell'} ({clues}); {left}"


_SENTENCES: dict[Kind, Callable[[Event], str]] = {
    "input": _input,
    "born": lambda event: f"id {event.id} is first seen, and not yet taken for a person",
    "confirmed": lambda event: f"id {event.id} is taken for a person",
    "unseen": _unseen,
    "seen": lambda event: f"id {event.id} is seen on its own again",
    "unsure": _unsure,
    "sure": _sure,
    "gone": lambda event: f"id {event.id} is not tracked any more; it may be re-identified",
    "forgotten": lambda event: f"id {event.id} is forgotten, and never comes back",
    "contact": lambda event: (
        f"ids {event.id} and {event.other} come into contact: either track may leave with the "
        "other's person"
    ),
    "decided": _decided,
    "assigned": _assigned,
    "returned": _returned,
    "re-identified": _re_identified,
    "new": _new,
    "given up": _given_up,
    "verifying": _verifying,
    "verified": _verified,
    "full": lambda _: "the trace file is full and ends here",
}


def _newcomer(event: Event) -> str:
    return f"newcomer id {event.other}" if event.other else "a newcomer without an id yet"


def _rest(event: Event, unknown: str = "the next best known person") -> str:
    if event.runner_up_probability is None or event.runner_up_probability < _UNLIKELY:
        return ""
    who = f"id {event.runner_up}" if event.runner_up else unknown
    return f"; runner-up: {who} with {percent(event.runner_up_probability)}"


def _chance(log_odds: float | None) -> str:
    if log_odds is None:
        return "nothing"
    return percent(0.5 * (1.0 + math.tanh(0.5 * log_odds)))


def percent(probability: float | None) -> str:
    """As text; nothing is certain, so that none is 0 or 100 %."""
    if probability is None:
        return "an unknown probability"
    value = 100.0 * probability
    if value < 0.1 or value > 99.9:
        return "under 0.1 %" if value < 0.1 else "over 99.9 %"
    return f"{value:.{0 if 1.0 <= value <= 99.0 else 1}f} %"
