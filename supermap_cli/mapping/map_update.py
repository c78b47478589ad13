"""MapMerge (Algorithm 1, step 5): what a keyframe's evidence amounts to for the map as a whole.

Objects are confirmed, recognized elsewhere (relocation), merged with what they turned out to be, and forgotten. The
paper's MapMerge only writes the neighbours back; the rest is needed for objects that keep their identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from supermap_cli.config import Ablation
from supermap_cli.mapping.association import is_recent
from supermap_cli.mapping.duplicates import near_pairs, older_first, same_object
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.lifecycle import is_demoted, ready_to_confirm
from supermap_cli.mapping.objects import MapObject, ObjectMap
from supermap_cli.mapping.pair_evidence import PairEvidence
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.recall import ScoreModel
from supermap_cli.mapping.relocation import Relocation, by_presence, relocations
from supermap_cli.mapping.splitting import SplitEvidence
from supermap_cli.mapping.transitions import Transitions


@dataclass
class IdentityLinks:
    """Pairs (absent, found) that are written as identity candidates already, and the objects that have absorbed
    another one since identities were last compared.
    """

    candidates: set[tuple[int, int]] = field(default_factory=set)
    absorbed: set[int] = field(default_factory=set)


@dataclass
class MapUpdate:
    """Carries out, for the whole map, what `lifecycle`, `relocation` and `duplicates` decide."""

    objects: ObjectMap
    transitions: Transitions
    free_space: FreeSpaceMemory
    scores: ScoreModel
    pairs: PairEvidence
    splits: SplitEvidence
    links: IdentityLinks
    ablate: frozenset[Ablation]
    parameters: MappingParameters

    def update(self, stamp_ns: int, matched: set[int]) -> None:
        """After a keyframe that has `matched` these objects."""
        self.forget_dynamic(stamp_ns)
        self._confirm()
        if "tracker" not in self.ablate:
            self._merge(matched, stamp_ns)
        self.forget()

    def forget_dynamic(self, stamp_ns: int | None) -> None:
        """What moves by itself is believed in only while it is seen: nobody saw it go, but nothing keeps it there.

        `None`: the traversal ends.
        """
        for obj in self.objects:
            unseen = stamp_ns is None or not is_recent(obj, stamp_ns, self.parameters.association)
            if unseen and obj.present and obj.is_dynamic:
                least = self.parameters.lifecycle.forget_log_odds
                obj.existence.log_odds = min(obj.existence.log_odds, least)

    def forget(self, *, ended: bool = False) -> None:
        """Drop tentative objects that nothing speaks for; demote confirmed ones, until they are confirmed again.

        When a traversal has `ended`, no more views come that might still speak for an object: one threshold decides
        what its map holds. What was dropped for misses alone was clutter; what went away, or moves by itself, had been
        there.
        """
        for obj in list(self.objects):
            if not obj.confirmed:
                if obj.existence_log_odds <= self.parameters.lifecycle.forget_log_odds or not obj.present:
                    if obj.present and not obj.is_dynamic:
                        self.scores.record_clutter(observation.score for observation in obj.pending)
                    self.objects.remove(obj.number)
                continue
            lifecycle = self.parameters.lifecycle
            demoted = is_demoted(obj, lifecycle) or (ended and obj.confidence < lifecycle.min_confidence)
            if demoted != obj.demoted:
                self.transitions.set_demoted(obj, demoted=demoted)

    def _confirm(self) -> None:
        parameters = self.parameters.lifecycle
        newly = [obj for obj in self.objects if not obj.confirmed and ready_to_confirm(obj, parameters)]
        for obj in newly:
            points = obj.shape.points
            empty_ns = self.free_space.last_seen_empty(points, obj.voxels.voxel_m, obj.state.first_seen_ns)
            obj.state.empty_before_ns = empty_ns
            obj.set_status(confirmed=True)
        relocated = set() if "tracker" in self.ablate else self._relocate_new(newly)
        for obj in newly:
            if obj.number not in relocated:
                self.transitions.confirm(obj)

    def end_traversal(self) -> None:
        """What moves by itself is believed to be nowhere from now on; identities are judged by all that was seen."""
        self.forget_dynamic(None)
        if "tracker" not in self.ablate:
            gone, found, standing = by_presence(self.objects)
            self._relocate(relocations(gone, found, standing, self.parameters.relocation))
        self.forget(ended=True)

    def _relocate_new(self, newly: Sequence[MapObject]) -> set[int]:
        """Objects found that are absent objects: they take over the identity, if the evidence singles it out.

        A pair is judged at the later of two events: the one confirmed, the other seen to be gone; either may be noticed
        first. It is judged again when two that were found have turned out to be one: that may end an ambiguity, and at
        the end of the traversal, when both have been seen from more sides.
        """
        gone, found, standing = by_presence(self.objects)
        news = {obj.number for obj in newly} | {obj.number for obj in gone if obj.number in self.transitions.touched}
        news |= self.links.absorbed
        self.links.absorbed = set()
        if not gone or not news:
            return set()
        matches = relocations(gone, found, standing, self.parameters.relocation)
        return self._relocate([match for match in matches if not news.isdisjoint((match.gone, match.found))])

    def _relocate(self, matches: Sequence[Relocation]) -> set[int]:
        """Carry out what is certain, note what is possible; the numbers of the objects that were taken over."""
        taken = set()
        for match in matches:
            old, new = self.objects[match.gone], self.objects[match.found]
            if match.certain:
                self.transitions.relocate(old, new)
                taken.add(new.number)
            elif (old.number, new.number) not in self.links.candidates:
                self.links.candidates.add((old.number, new.number))
                self.transitions.link_candidate(old, new, match.probability)
        return taken

    def _merge(self, matched: set[int], stamp_ns: int) -> None:
        for first, second in near_pairs(self.objects, matched, self.parameters.duplicates):
            if first.number not in self.objects.by_number or second.number not in self.objects.by_number:
                continue
            if self.pairs.surely_two(first, second):
                continue
            apart = second.number in first.seen_apart
            as_one = self.pairs.seen_as_one(first, second)
            if as_one or same_object(first, second, seen_apart=apart, parameters=self.parameters.duplicates):
                kept, joined = older_first(first, second)
                self.transitions.merge(kept, joined, stamp_ns)
                self.pairs.forget(joined.number)
                self.splits.forget(joined.number)
                self.links.absorbed.add(kept.number)
