"""Instances as an answer lists them, with their evidence, their near misses, and what is not known of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain, islice

from supermap_cli.language.questions import Anything, Identified, Named, Noun, Related, Things, Union, Usable
from supermap_cli.memory.scored_observations import scored_observations_of
from supermap_cli.memory.values import ScoredObservation, StoredInstance
from supermap_cli.query.answering.conditions import Judgement
from supermap_cli.query.answering.document import AskedRelation, NearMiss
from supermap_cli.query.answering.nouns import noun_text
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.things import ThingsFinder, conditions_of
from supermap_cli.query.candidates import InstanceCandidate, LabelCandidates, label_in_state, sorted_by_number
from supermap_cli.query.near_misses import MAX_NEAR_MISSES, maybe_labelled, nearest_pairs
from supermap_cli.query.presence_at import describe_presence, presence_view
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.query.uncertain_presence import MAX_NOTED, NO_UNCERTAIN, UncertainInstances, uncertain_instances
from supermap_cli.query.views import (
    InstanceView,
    box_view,
    evidence_view,
    interval_view,
    support_spans,
    vector,
)
from supermap_cli.types.existence import probability_of
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import StateRecord


class Lister:
    """Lists what a finder found."""

    def __init__(self, finder: ThingsFinder) -> None:
        self.finder = finder
        self.asking = finder.asking
        self.reader = finder.reader
        self.selector = finder.selector

    # -- matches

    def views(self, candidates: Iterable[InstanceCandidate]) -> tuple[InstanceView, ...]:
        """Candidates grouped by instance; the newest matching state gives position and label."""
        by_instance: dict[int, Candidates] = {}
        for candidate in candidates:
            by_instance.setdefault(candidate.instance.number, []).append(candidate)
        instances = {instance.number: instance for instance in self.reader.instances_of(list(by_instance))}
        observed = scored_observations_of(self.reader, instances.values())
        return tuple(
            self._view(instances[number], of_one, observed[number]) for number, of_one in sorted(by_instance.items())
        )

    def instances(self, instances: Iterable[StoredInstance]) -> tuple[InstanceView, ...]:
        """Whole instances in their newest state."""
        return self.views(InstanceCandidate(instance, instance.states[-1]) for instance in instances if instance.states)

    def asked_relation(self, things: Things) -> AskedRelation | None:
        """The first relation of a phrase with its reference instances."""
        related = first_relation(things)
        if related is None:
            return None
        references: dict[int, str] = {}
        more = False
        source = self.finder.references(related.reference)
        for candidate in chain.from_iterable(source.batches()):
            if len(references) == self.asking.limit and candidate.instance.number not in references:
                more = True
                break
            references[candidate.instance.number] = candidate.instance.id
        ids = tuple(text_id for _, text_id in sorted(references.items()))
        return AskedRelation(related.relation, noun_text(related.reference.noun, "anything"), ids, more)

    # -- what does not match

    def nearest(self, things: Things, dropped: Sequence[Judgement] = ()) -> tuple[NearMiss, ...]:
        """Near misses: out of the relation's reach, denied by a condition (`dropped`), absent at the selected time, or
        possibly of that label.
        """
        if (unknown := self.unknown_noun(things)) is not None:
            return self._possible(unknown)
        if dropped:
            telling = [each for each in dropped if things.noun != Anything() or not each.reason.startswith("not ")]
            return tuple(self.near_miss(each.candidate.instance, each.candidate.state, each.reason) for each in telling)
        related = first_relation(things)
        if related is not None and (out_of_reach := self._out_of_reach(things, related)):
            return out_of_reach
        return self._told(self._first_named(things.noun))

    def near_miss(
        self, instance: StoredInstance, state: StateRecord, reason: str, distance_m: float | None = None
    ) -> NearMiss:
        """An instance that does not match, with the reason."""
        presence_then = self.selector.presence(instance)
        return NearMiss(
            instance.id,
            instance.label,
            instance.presence if presence_then is None else presence_then.value,
            vector(state.centroid_map),
            box_view(state.box),
            reason,
            None if distance_m is None else round(distance_m, 4),
        )

    def unknown_noun(self, things: Things) -> Noun | None:
        """The first noun of a phrase that names nothing the map has ever held."""
        if not self.asking.is_known(things.noun):
            return things.noun
        for condition in conditions_of(things):
            if isinstance(condition, Related) and (unknown := self.unknown_noun(condition.reference)) is not None:
                return unknown
        return None

    def uncertain(self, things: Things, matches: Iterable[InstanceView], *, counting: bool) -> UncertainInstances:
        """Instances of that label whose presence at the selected time is unknown; none for a restricted phrase."""
        source = self.finder.named(things.noun, any_state=True)
        if conditions_of(things) or not isinstance(source, LabelCandidates):
            return NO_UNCERTAIN
        over_time = self.selector.kind in {"traversal", "earlier", "during"}
        if over_time and not counting and not source_is_everything(source):
            source = replace(source, selector=self._at_end())
        return uncertain_instances(source, matches, counting=counting)

    def _at_end(self) -> TimeSelector:
        """The end of the selected time, as one time."""
        selector = self.selector
        at_ns = selector.high_ns - 1 if selector.kind == "earlier" else selector.high_ns
        since_ns = None if selector.traversal is None else selector.traversal.start_ns
        return TimeSelector("at", selector.text, at_ns, at_ns, since_ns=since_ns)

    def note_uncertain(self, uncertain: UncertainInstances) -> None:
        """Add notes on what is known of instances whose presence is unknown."""
        listed = uncertain.instances[:MAX_NOTED]
        self.asking.note(*(f"{instance.id}: {self.presence_text(instance)}" for instance in listed))
        if uncertain.count > MAX_NOTED:
            of = "" if uncertain.searched is None else f", of the {uncertain.searched} seen last"
            self.asking.note(f"the same of {uncertain.count - MAX_NOTED} more{of}")

    def presence_text(self, instance: StoredInstance) -> str:
        """What is known of an instance's presence, in words; "gone" only after a contradiction."""
        clock, selector = self.asking.clock, self.selector
        if selector.kind in {"traversal", "earlier", "during"} and math.isfinite(selector.high_ns):
            selector = self._at_end()
        if (presence := selector.presence(instance)) is not None and presence.cause != "stands":
            return describe_presence(presence, int(selector.low_ns), clock)
        state = instance.states[-1]
        seen = f"last seen {clock.text(state.last_seen_ns)}"
        if instance.label in DYNAMIC_CLASSES:
            return seen
        if instance.presence == "doubted":
            probability = probability_of(instance.existence_log_odds)
            return f"{seen}, and doubted since: real with {probability:.0%}"
        if state.gone_ns is not None:
            return f"{seen}, gone {clock.between(state.last_seen_ns, state.gone_ns)}"
        return f"{seen}, not seen since" if instance.presence == "absent" else seen

    # -- parts

    def _possible(self, noun: Noun) -> tuple[NearMiss, ...]:
        """What may be of an unknown noun: doubted instances, uncertain labels, similar names."""
        match noun:
            case Identified(text_id):
                return self._alike(text_id)
            case Named() if doubted_labels := self.asking.doubted_labels(noun):
                doubted = islice(self.reader.search.labelled(doubted_labels, ["doubted"]), MAX_NEAR_MISSES)
                return self._told(sorted_by_number(self.reader.instances_by_number(list(doubted))))
            case Named():
                return self._maybe(noun)
            case Union(members):
                return tuple(chain.from_iterable(self._possible(member.noun) for member in members))[:MAX_NEAR_MISSES]
            case _:
                return ()

    def _alike(self, text_id: str) -> tuple[NearMiss, ...]:
        """The doubted instance with an id; else others that are called so."""
        doubted = self.reader.instance(text_id)
        if doubted is not None and doubted.states:
            return self._told([doubted])
        head = text_id.rsplit("-", 1)[0].replace("-", " ")
        return self._told(self._first_named(Named(head, head))) or self._maybe(Named(head, head))

    def _told(self, instances: Iterable[StoredInstance]) -> tuple[NearMiss, ...]:
        """Instances with what is known of their presence."""
        known = (each for each in instances if each.states)
        return tuple(self.near_miss(each, each.states[-1], self.presence_text(each)) for each in known)

    def _maybe(self, noun: Named) -> tuple[NearMiss, ...]:
        possible = maybe_labelled(self.reader, noun.name, self.asking.words)
        return tuple(self.near_miss(instance, instance.states[-1], reason) for instance, reason in possible)

    def _first_named(self, noun: Noun) -> list[StoredInstance]:
        """The first few instances that a noun ever named and that have a state."""
        match noun:
            case Identified(text_id):
                instance = self.asking.instance(text_id)
                return [instance] if instance is not None and instance.states else []
            case Named() | Usable():
                labels: frozenset[str] | None = self.asking.labels(noun).labels
            case Anything():
                labels = None
            case _:
                return []
        search = self.reader.search
        numbers = search.first_labelled(labels, MAX_NEAR_MISSES)
        numbers += [] if labels is None else search.formerly_labelled(labels)
        return sorted_by_number(self.reader.instances_by_number(sorted(numbers)[:MAX_NEAR_MISSES]))

    def _out_of_reach(self, things: Things, related: Related) -> tuple[NearMiss, ...]:
        """The pairs closest to fulfilling the relation, by box distance."""
        candidates = self.finder.named(things.noun, any_state=True)
        if not isinstance(candidates, LabelCandidates):
            return ()
        pairs = nearest_pairs(self.reader, candidates, self.finder.source(related.reference))
        return tuple(
            self.near_miss(
                pair.candidate.instance,
                pair.candidate.state,
                f"{pair.distance_m:.2f} m from {pair.reference.instance.id}, not {related.relation} it",
                pair.distance_m,
            )
            for pair in pairs
        )

    def _view(
        self, instance: StoredInstance, candidates: Candidates, observed: Sequence[ScoredObservation]
    ) -> InstanceView:
        newest = max(candidates, key=lambda candidate: candidate.state.index)
        states = tuple(candidate.state for candidate in candidates)
        of_traversal = None if self.selector.traversal is None else {self.selector.traversal.id}
        presence = self.selector.presence(instance)
        return InstanceView(
            id=instance.id,
            label=label_in_state(newest.instance, newest.state),
            presence=instance.presence if presence is None else presence.value,
            position=vector(newest.state.centroid_map),
            box=box_view(newest.state.box),
            confidence=round(newest.state.confidence, 4),
            intervals=tuple(interval_view(state) for state in states),
            relations=tuple(view for candidate in candidates for view in candidate.relations),
            evidence=evidence_view(self.reader, instance, support_spans(states), of_traversal, observed),
            standing=None
            if presence is None
            else presence_view(presence, int(self.selector.low_ns), self.asking.clock),
        )


def source_is_everything(source: LabelCandidates) -> bool:
    """Whether a source is all that the map holds."""
    return source.labels is None and source.number is None


def first_relation(things: Things) -> Related | None:
    """The first relation that a phrase is restricted by."""
    related = (condition for condition in conditions_of(things) if isinstance(condition, Related))
    return next((condition for condition in related if not condition.inverse), None)
