"""The tracker: one frame's blobs in, its people out. No transport, no clock, deterministic."""

from __future__ import annotations

from collections.abc import Sequence

from schemas import Blobs, Tracks
from schemas.base import BoxXyxy
from schemas.tracks import MAX_TRACKS
from services.tracker import boxes
from services.tracker.assignment import assign
from services.tracker.clusters import Cluster, fragments_of, hiding_blob, may_merge, parts_of
from services.tracker.features import FeatureExtractor, PaperAndColourFeatures, PaperFeatures
from services.tracker.lifecycle import Person
from services.tracker.measurement import VISIBLE_SHARE, in_group, take_in_one
from services.tracker.report import tracks_message
from services.tracker.settings import TrackerSettings
from services.tracker.splitting import split
from services.tracker.timing import FrameClock
from services.tracker.view import Sighting, View

Pairs = list[tuple[Cluster, Sighting | None]]
_GROUP_DOUBT = 4.0


class Tracker:
    """Kalman filter, Kuhn-Munkres, occlusion, identity retention.

    People are held in clusters: one person, or several who share a blob. Each frame, clusters are
    matched to blobs; a group that has fallen into parts is split, a cluster whose people lie under
    another's blob is merged with it.

    Usage:
        tracker = Tracker(TrackerSettings())
        tracks = tracker.update(blobs)
    """

    def __init__(self, settings: TrackerSettings, features: FeatureExtractor | None = None) -> None:
        """Start with nobody known.

        Args:
            settings: a preset and what is changed in it.
            features: what identities are compared by; None for those the settings name.
        """
        self.settings = settings
        self._features = features or _extractor(settings)
        self._clusters: list[Cluster] = []
        self._scene: tuple[str, int, int, int] | None = None
        self._clock = FrameClock()
        self._next_id = 1
        self._count_before = 0

    def update(self, blobs: Blobs) -> Tracks:
        """Take in one frame.

        A new size, stream or epoch forgets everybody; ids are never used again all the same.

        Raises:
            MessageError: the evidence map does not unpack; nothing has changed then.
        """
        view = View(blobs)
        self._start_over_if_new(blobs)
        dt_s = self._clock.elapsed_s(blobs.t_capture_ns)
        for cluster in self._clusters:
            cluster.predict(dt_s)
        pairs, free = self._match(view.sightings)
        pairs, free = self._split_groups(pairs, free, view)
        pairs, free = self._merge(pairs, free)
        free = self._measure(pairs, free, view, dt_s)
        self._clusters = _living(pairs, (0.0, 0.0, float(blobs.width), float(blobs.height)))
        self._give_birth(free, view)
        self._count_before = len(view.sightings)
        return tracks_message(blobs, self._clusters)

    def _start_over_if_new(self, blobs: Blobs) -> None:
        scene = (blobs.stream, blobs.epoch, blobs.width, blobs.height)
        if scene != self._scene:
            self._scene = scene
            self._clusters = []
            self._clock = FrameClock()
            self._count_before = 0

    def _match(self, sightings: Sequence[Sighting]) -> tuple[Pairs, list[Sighting]]:
        matches = assign(
            [cluster.box for cluster in self._clusters],
            [sighting.box for sighting in sightings],
            self.settings,
        )
        pairs: Pairs = [
            (cluster, sightings[matches[index]] if index in matches else None)
            for index, cluster in enumerate(self._clusters)
        ]
        return pairs, _without(sightings, [sighting for _, sighting in pairs])

    def _split_groups(
        self, pairs: Pairs, free: list[Sighting], view: View
    ) -> tuple[Pairs, list[Sighting]]:
        after: Pairs = []
        for cluster, sighting in pairs:
            parts = parts_of(cluster, sighting, free, self.settings) if cluster.is_group else []
            parts = parts[: len(cluster.people)]
            if len(parts) < 2:
                after.append((cluster, sighting or next(iter(parts), None)))
            else:
                after += split(cluster.people, parts, view, self._features, self.settings)
            free = _without(free, parts)
        return after, free

    def _merge(self, pairs: Pairs, free: list[Sighting]) -> tuple[Pairs, list[Sighting]]:
        """Put clusters without a blob to the one that covers them, if the occlusion test agrees."""
        owner = {id(sighting): cluster for cluster, sighting in pairs if sighting is not None}
        sightings = [sighting for _, sighting in pairs if sighting is not None] + free
        after = [(cluster, sighting) for cluster, sighting in pairs if sighting is not None]
        missing = [cluster for cluster, sighting in pairs if sighting is None]
        counts = (self._count_before, len(sightings))
        unmerged: Pairs = []
        for cluster in missing:
            blob = hiding_blob(cluster, sightings, self.settings)
            host = owner.get(id(blob))
            if blob is None or not cluster.is_confirmed:
                unmerged.append((cluster, None))
            elif host is None:
                owner[id(blob)] = cluster
                after.append((cluster, blob))
                free = _without(free, [blob])
            elif self._may_join(cluster, host, blob, counts):
                host.take_in(cluster)
            else:
                unmerged.append((cluster, None))
        return [*after, *unmerged], free

    def _may_join(
        self, cluster: Cluster, host: Cluster, blob: Sighting, counts: tuple[int, int]
    ) -> bool:
        people = [*host.people, *cluster.people]
        if not host.is_confirmed or len(people) > self.settings.max_group:
            return False
        return may_merge([person.box for person in people], blob.box, counts, self.settings)

    def _measure(
        self, pairs: Pairs, free: list[Sighting], view: View, dt_s: float
    ) -> list[Sighting]:
        for cluster, sighting in pairs:
            if sighting is None:
                for person in cluster.people:
                    person.missed(dt_s)
                continue
            pieces: list[Sighting] = []
            if self.settings.join_fragments:
                pieces = fragments_of(boxes.union([cluster.box, sighting.box]), free)
                free = _without(free, pieces)
            blob = boxes.union([piece.box for piece in [sighting, *pieces]])
            if cluster.is_group:
                self._measure_group(cluster, blob, view, dt_s)
            else:
                self._measure_one(cluster.people[0], sighting, blob, view, dt_s)
            cluster.box = blob
        return free

    def _measure_one(
        self, person: Person, sighting: Sighting, blob: BoxXyxy, view: View, dt_s: float
    ) -> None:
        whole = take_in_one(person, blob, self.settings)
        person.seen_alone(dt_s)
        if whole:
            person.remember(self._features.extract(sighting.pixels, view.mask(sighting)), dt_s)

    def _measure_group(self, cluster: Cluster, blob: BoxXyxy, view: View, dt_s: float) -> None:
        fit = self.settings.fit_groups_to_evidence
        places = in_group(cluster.people, blob, view) if fit else None
        for index, person in enumerate(cluster.people):
            if places is None:
                person.filter.coast(dt_s)
                person.filter.place(boxes.kept_inside(person.box, blob))
                person.seen_in_group(True, dt_s)
                continue
            place = places[index]
            person.filter.correct_centre(place.centre, 1.0 + _GROUP_DOUBT * (1.0 - place.visible))
            person.seen_in_group(place.visible > VISIBLE_SHARE, dt_s)

    def _give_birth(self, free: Sequence[Sighting], view: View) -> None:
        room = MAX_TRACKS - sum(len(cluster.people) for cluster in self._clusters)
        for sighting in free[: max(0, room)]:
            person = Person(self._next_id, sighting.box, self.settings)
            person.remember(self._features.extract(sighting.pixels, view.mask(sighting)), 0.0)
            self._clusters.append(Cluster([person], sighting.box))
            self._next_id += 1


def _extractor(settings: TrackerSettings) -> FeatureExtractor:
    if settings.features == "paper":
        return PaperFeatures()
    return PaperAndColourFeatures(settings.colour_weight)


def _without(sightings: Sequence[Sighting], taken: Sequence[Sighting | None]) -> list[Sighting]:
    return [sighting for sighting in sightings if sighting not in taken]


def _living(pairs: Pairs, frame_box: BoxXyxy) -> list[Cluster]:
    clusters = []
    for cluster, _ in pairs:
        alive = [person for person in cluster.people if not person.is_dead(frame_box)]
        if alive:
            clusters.append(Cluster(alive, cluster.box))
    return clusters
