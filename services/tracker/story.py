"""A trace told in sentences: what became of an id, why, and what else it might have been."""

from __future__ import annotations

import math
from collections.abc import Sequence

from heel.services.tracker.trace import Event

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
    own, sure, rest = f"id {event.id}", percent(event.probability), _rest(event)
    match event.kind:
        case "input":
            return f"{_INPUTS[event.input or 'foreground']}; {_METHODS[event.method or 'evidence']}"
        case "born":
            return f"{own} is first seen, and not yet taken for a person"
        case "confirmed":
            return f"{own} is taken for a person"
        case "unseen":
            why = f"hidden by id {event.other}" if event.other else "and nothing known hides it"
            return f"{own} is not seen on its own any more, {why}"
        case "seen":
            return f"{own} is seen on its own again"
        case "unsure":
            return f"{own} is unsure: {sure} that it is on the same person{rest}"
        case "sure":
            return f"{own} is sure again: {sure}{rest}"
        case "gone":
            return f"{own} is not tracked any more; it may be re-identified"
        case "forgotten":
            return f"{own} is forgotten, and never comes back"
        case "contact":
            either = "either track may leave with the other's person"
            return f"ids {event.id} and {event.other} come into contact: {either}"
        case "decided":
            return f"the contact of ids {event.id} and {event.other} {_decision(event)}"
        case "assigned":
            kept = f"{own} is decided to be on its own person"
            other = f"the track that was {own} is decided to be the person of id {event.other}"
            what = kept if event.outcome == "kept" else other
            return f"after the contact {what}, with {sure}{rest}"
        case "returned":
            return f"{own} has a box again after a gap: {sure} that it is the same person{rest}"
        case "re-identified":
            who = f"the track that was id {event.other}" if event.other else "a new track"
            known = f"is taken for the person of {own} that was out of sight, with {sure}"
            return f"{who} {known}{_rest(event, unknown='a new person')}"
        case "new":
            stays = f"{own} is compared with people out of sight, and stays a person of its own"
            if not event.runner_up or (event.runner_up_probability or 0.0) < _UNLIKELY:
                return f"{stays}: none of them is likely"
            best = f"id {event.runner_up} with {percent(event.runner_up_probability)}"
            return f"{stays}: the likeliest of them is {best}, which is too little"
        case "given up":
            cause = _CAUSES[event.cause or "confidence"]
            on = f"the track goes on as id {event.other}"
            return f"{own} is given up ({sure} left), as {cause}; {on}{rest}"
        case "verifying":
            until = "until both are seen alone it is open on which of them the id is"
            return f"{_newcomer(event)} came forth from the box of {own}: {until}"
        case "verified":
            left = f"{sure} is left, doubts of before included"
            return f"{own} against {_newcomer(event)}: {_verified(event)}; {left}"
        case "full":
            return "the trace file is full and ends here"


def _decision(event: Event) -> str:
    """What became of a contact, and which clues said so."""
    sure = percent(event.probability)
    clues = (
        f"(motion alone says {_chance(event.motion_log_odds)} that both stayed, colours alone "
        f"{_chance(event.looks_log_odds)})"
    )
    if event.outcome == "exchanged":
        back = f"the tracks had changed people, with {sure}, so the ids were exchanged back"
        return f"is decided: {back} {clues}"
    if event.outcome == "kept":
        return f"is decided: each stayed with its person, with {sure} {clues}"
    return f"ends undecided: each is left where it is, with {sure} {clues}"


def _verified(event: Event) -> str:
    if event.before_log_odds is None:
        return "that one is gone before both were seen alone"
    found = event.outcome if event.outcome in ("confirmed", "refuted") else "colours cannot tell"
    return (
        f"{found} (colours of before say {_chance(event.before_log_odds)} that it stayed, colours "
        f"of the split {_chance(event.split_log_odds)})"
    )


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
