"""Probabilities of identities, from distances of appearance descriptors and from what motion says.

A distance of descriptors speaks in nats: on the recordings a mean descriptor is 0.13 (95 %: 0.20)
from the person's own gallery and 0.39 (5 %: 0.22) from another person's, so that 0.24 speaks for
neither.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heel.services.geometry.assignment import cheapest, cheapest_without
from heel.services.tracker.evidence.arrays import Floats

_NATS_PER_DISTANCE = 1.0 / 0.03
"""Nats for each unit of distance: the likelihood falls to 1/e with each 0.03; chosen by hand within
the spread above."""
UNKNOWN_NATS = 0.24 * _NATS_PER_DISTANCE
"""Nats of a descriptor that speaks neither for nor against, and of a person without a gallery."""
_OUTLIER = 0.03
"""Share of descriptors of the right person that say nothing, as they hold pixels of another person
or a lamp post; chosen by hand."""
_IMPOSSIBLE = 1e4
"""Nats of a pair that is ruled out: more than any sum of possible ones."""
_MOST_NATS = 50.0
"""Nats at which a margin is capped: exp(-50) is as good as 0."""


def look_nats(distance: float) -> float:
    """Negative log-likelihood of a mean distance of descriptors, up to a constant."""
    told = (1.0 - _OUTLIER) * math.exp(-distance * _NATS_PER_DISTANCE)
    return -math.log(told + _OUTLIER * math.exp(-UNKNOWN_NATS))


@dataclass(frozen=True)
class Verdict:
    """The identity decided for one person.

    Attributes:
        column: index of the identity; -1 for none of those known.
        confidence: that this is right, 0 to 1; 0 for none.
        runner_up: the same for the best other identity.
        second: index of that one; -1 for none of those known.
    """

    column: int
    confidence: float
    runner_up: float
    second: int = -1


def decide(nats: Floats, stranger_nats: Sequence[float]) -> list[Verdict]:
    """The most probable one-to-one assignment of people to identities (Kuhn-Munkres).

    Args:
        nats: (people, identities), negative log-likelihood with the prior in it.
        stranger_nats: the same for each person being none of them.
    """
    people, identities = nats.shape
    costs: Floats = np.full((people, identities + people), _IMPOSSIBLE)
    costs[:, :identities] = nats
    costs[np.arange(people), identities + np.arange(people)] = stranger_nats
    best = cheapest(costs)
    verdicts = []
    for row, column in enumerate(best.columns.tolist()):
        other = cheapest_without(costs, row, column, _IMPOSSIBLE)
        margin = other.total - best.total
        confidence = 1.0 / (1.0 + math.exp(-min(margin, _MOST_NATS)))
        other_known = bool(other.columns[row] < identities)
        if column >= identities:
            verdicts.append(Verdict(-1, 0.0, 0.0))
        else:
            rest = 1.0 - confidence if other_known else 0.0
            second = int(other.columns[row]) if other_known else -1
            verdicts.append(Verdict(column, confidence, rest, second))
    return verdicts


def among(nats: Sequence[float], prior: float) -> Verdict:
    """The most probable of several identities for one person that may also be new.

    Args:
        nats: of the descriptors, by identity; at least one.
        prior: that the person is one of them at all, 0 to 1, shared evenly.
    """
    known = np.asarray(nats) - math.log(prior / len(nats))
    costs = np.append(known, UNKNOWN_NATS - math.log(1.0 - prior))
    shares = np.exp(-np.minimum(costs - costs.min(), _MOST_NATS))
    shares /= shares.sum()
    best = int(np.argmax(shares[:-1]))
    others = np.delete(shares[:-1], best)
    second = int(np.argmax(np.where(np.arange(len(nats)) == best, -1.0, shares[:-1])))
    return Verdict(
        best, float(shares[best]), float(others.max(initial=0.0)), second if len(others) else -1
    )
