"""The paper's tracker: Kalman filter, Kuhn-Munkres, occlusion, identity retention."""

from __future__ import annotations

from collections.abc import Sequence

from heel.schemas import Blobs, Track
from heel.schemas.base import BoxXyxy
from heel.schemas.tracks import MAX_TRACKS
from heel.services.geometry import boxes
from heel.services.tracker.paper.assignment import assign
from heel.services.tracker.paper.clusters import Cluster, hiding_blob, parts_of
from heel.services.tracker.paper.features import extract
from heel.services.tracker.paper.lifecycle import Person
from heel.services.tracker.paper.occlusion import classify
from heel.services.tracker.paper.report import reports_of
from heel.services.tracker.paper.settings import BlobSettings
from heel.services.tracker.paper.sighting import Sighting, sightings_of
from heel.services.tracker.paper.splitting import split
from heel.services.tracker.report import tracks_of
from heel.services.tracker.trace import Trace

Pairs = list[tuple[Cluster, Sighting | None]]


class BlobTracker:
    """People of one scene.

    People are held in clusters: one person, or several that share a blob. Each frame, clusters are
    matched to blobs; a group that has fallen into parts is split, a cluster whose people lie under
    another's blob is merged with it.
    """

    def __init__(self, next_id: int, trace: Trace | None = None) -> None:
        """Start without people; the first one gets `next_id`."""
        self.next_id = next_id
        self._trace = trace
        self._settings = BlobSettings()
        self._clusters: list[Cluster] = []
        self._count_before = 0

    def update(self, blobs: Blobs, dt_s: float) -> list[Track]:
        """Tracks of one frame, by id.

        Args:
            blobs: the message; its evidence map is not used.
            dt_s: seconds since the frame before.
        """
        sightings = sightings_of(blobs)
        for cluster in self._clusters:
            cluster.predict(dt_s)
        pairs, free = self._match(sightings)
        pairs, free = self._split_groups(pairs, free)
        pairs, free = self._merge(pairs, free)
        self._measure(pairs, dt_s)
        self._clusters = _living(pairs, (0.0, 0.0, float(blobs.width), float(blobs.height)))
        self._give_birth(free)
        self._count_before = len(sightings)
        return tracks_of(reports_of(self._clusters))

    def _match(self, sightings: Sequence[Sighting]) -> tuple[Pairs, list[Sighting]]:
        matches = assign(
            [cluster.box for cluster in self._clusters],
            [sighting.box for sighting in sightings],
        )
        pairs: Pairs = [
            (cluster, sightings[matches[index]] if index in matches else None)
            for index, cluster in enumerate(self._clusters)
        ]
        return pairs, _without(sightings, [sighting for _, sighting in pairs])

    def _split_groups(self, pairs: Pairs, free: list[Sighting]) -> tuple[Pairs, list[Sighting]]:
        after: Pairs = []
        for cluster, sighting in pairs:
            parts = parts_of(cluster, sighting, free, self._settings) if cluster.is_group else []
            parts = parts[: len(cluster.people)]
            if len(parts) < 2:
                after.append((cluster, sighting or next(iter(parts), None)))
            else:
                after += split(cluster.people, parts, self._settings, self._trace)
            free = _without(free, parts)
        return after, free

    def _merge(self, pairs: Pairs, free: list[Sighting]) -> tuple[Pairs, list[Sighting]]:
        """Put clusters without a blob to the one that covers them, if the occlusion test agrees."""
        owner = {id(sighting): cluster for cluster, sighting in pairs if sighting is not None}
        sightings = [sighting for _, sighting in pairs if sighting is not None] + free
        after = [(cluster, sighting) for cluster, sighting in pairs if sighting is not None]
        missing = [cluster for cluster, sighting in pairs if sighting is None]
        unmerged: Pairs = []
        for cluster in missing:
            blob = hiding_blob(cluster, sightings, self._settings)
            host = owner.get(id(blob))
            if blob is None or not cluster.is_confirmed:
                unmerged.append((cluster, None))
            elif host is None:
                owner[id(blob)] = cluster
                after.append((cluster, blob))
                free = _without(free, [blob])
            elif self._may_join(cluster, host, blob, len(sightings)):
                host.take_in(cluster)
            else:
                unmerged.append((cluster, None))
        return [*after, *unmerged], free

    def _may_join(self, cluster: Cluster, host: Cluster, blob: Sighting, count: int) -> bool:
        people = [*host.people, *cluster.people]
        if not host.is_confirmed or len(people) > self._settings.max_group:
            return False
        hidden = [person.box for person in people]
        ratio = self._settings.aspect_ratio
        return classify(self._count_before, count, hidden, blob.box, ratio) == "inter_object"

    def _measure(self, pairs: Pairs, dt_s: float) -> None:
        for cluster, sighting in pairs:
            if sighting is None:
                for person in cluster.people:
                    person.missed(dt_s)
                continue
            if cluster.is_group:
                for person in cluster.people:
                    person.filter.coast(dt_s)
                    person.filter.place(boxes.kept_inside(person.box, sighting.box))
                    person.seen_in_group(dt_s)
            else:
                person = cluster.people[0]
                person.filter.correct(sighting.box)
                person.seen_alone(dt_s)
                person.remember(extract(sighting.pixels), dt_s)
            cluster.box = sighting.box

    def _give_birth(self, free: Sequence[Sighting]) -> None:
        room = MAX_TRACKS - sum(len(cluster.people) for cluster in self._clusters)
        for sighting in free[: max(0, room)]:
            person = Person(self.next_id, sighting.box, self._settings)
            person.remember(extract(sighting.pixels), 0.0)
            self._clusters.append(Cluster([person], sighting.box))
            self.next_id += 1


def _without(sightings: Sequence[Sighting], taken: Sequence[Sighting | None]) -> list[Sighting]:
    return [sighting for sighting in sightings if sighting not in taken]


def _living(pairs: Pairs, frame_box: BoxXyxy) -> list[Cluster]:
    clusters = []
    for cluster, _ in pairs:
        alive = [person for person in cluster.people if not person.is_dead(frame_box)]
        if alive:
            clusters.append(Cluster(alive, cluster.box))
    return clusters
