"""Answers questions by iterating over the whole map: a slow reference for the indexed implementation."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np

from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.parsing import parse
from supermap_cli.language.questions import Identified, Named, Related, Things
from supermap_cli.language.times import AtEvent
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.nouns import match_labels
from supermap_cli.query.answering.times import MomentSpan, QuestionTimes
from supermap_cli.query.answers import known_names
from supermap_cli.query.clock import clock_of
from supermap_cli.query.relations import STORED_FORMS, box_distance_m, holds
from supermap_cli.query.time_selector import TimeSelector
from supermap_cli.types.memory import SpatialEdge, StateRecord
from supermap_cli.types.relations import GraphNode

LEXICON = load_lexicon("en")
Match = tuple[StoredInstance, StateRecord, tuple[tuple[object, ...], ...]]


def no_events(_asked: AtEvent) -> MomentSpan:
    raise AssertionError("no question of these tests names an event")


@dataclass(frozen=True)
class NounPhrase:
    """A noun or id (`None`: any object), and an optional relation to another noun phrase."""

    noun: str | None
    relation: RelationPhrase | None = None


@dataclass(frozen=True)
class RelationPhrase:
    """A relation and its reference."""

    name: str
    reference: NounPhrase


def phrase_of(things: Things) -> NounPhrase:
    """A noun phrase with nothing but relations."""
    match things.noun:
        case Named(name):
            noun: str | None = name
        case Identified(text_id):
            noun = text_id
        case _:
            noun = None
    if isinstance(things.condition, Related):
        return NounPhrase(noun, RelationPhrase(things.condition.relation, phrase_of(things.condition.reference)))
    return NounPhrase(noun)


class BruteForce:
    """One question to one map."""

    def __init__(self, reader: MapReader, text: str) -> None:
        question = parse(text, known_names(reader))
        self.phrase = phrase_of(question.body.things)  # type: ignore[union-attr]
        self.selector: TimeSelector = QuestionTimes(reader, clock_of(reader), no_events).selector(
            question.time, past=question.past
        )
        self.everything = reader.instances
        self.believed = reader.believed
        self.edges: tuple[SpatialEdge, ...] = reader.edges_of([instance.number for instance in reader.instances])
        self.ids = {instance.number: instance.id for instance in reader.instances}
        self.parts = {reader.text_ids[part]: instance for instance in reader.instances for part in instance.numbers}

    def found(self) -> dict[str, tuple[list[int], list[tuple[object, ...]]]]:
        """The matching states and relations of each instance."""
        matching: dict[str, tuple[list[int], list[tuple[object, ...]]]] = {}
        for instance, state, relations in self._find(self.phrase, as_reference=False):
            states, all_relations = matching.setdefault(instance.id, ([], []))
            states.append(state.index)
            all_relations.extend(relations)
        return matching

    def uncertain_count(self) -> int:
        """The number of instances of that label that do not match and whose presence is unknown."""
        if self.selector.kind != "at" or self.phrase.relation is not None:
            return 0
        told = self.found().keys()
        known = [
            self.selector.presence(instance) for instance in self._labelled(self.phrase) if instance.id not in told
        ]
        return sum(presence is not None and presence.value == "unknown" for presence in known)

    def nearest(self) -> list[tuple[str, float | None]]:
        """The near misses and their distances."""
        if (missing := self._unknown_noun(self.phrase)) is not None:
            if (doubted := self.parts.get(missing)) is not None and doubted.states:
                return [(doubted.id, None)]
            head, dash, _ = missing.partition("-")
            alike = [instance for instance in self._labelled(NounPhrase(head)) if instance.states] if dash else []
            doubted_ones = [] if dash else self._doubted(head)
            told = [each.id for each in alike[:3]] or doubted_ones or self._maybe_labelled(head)
            return [(text_id, None) for text_id in told]
        if self.phrase.relation is not None and (out_of_reach := self._out_of_reach(self.phrase, self.phrase.relation)):
            return out_of_reach
        return [(instance.id, None) for instance in self._labelled(self.phrase) if instance.states][:3]

    def _find(self, phrase: NounPhrase, *, as_reference: bool) -> list[Match]:
        labels = None if phrase.noun is None or self._by_id(phrase.noun) else self._labels(phrase.noun)
        states_of = self.selector.reference_states if as_reference else self.selector.states
        matching: list[Match] = [
            (instance, state, ())
            for instance in self._labelled(phrase)
            for state in states_of(instance)
            if labels is None or (instance.label if state is instance.states[-1] else state.label) in labels
        ]
        return matching if phrase.relation is None else self._related(matching, phrase.relation)

    def _related(self, matching: list[Match], related: RelationPhrase) -> list[Match]:
        references = self._find(related.reference, as_reference=True)
        found: list[Match] = []
        for instance, state, _ in matching:
            views = []
            for reference, reference_state, _ in references:
                span = self.selector.span_of((state, instance), (reference_state, reference))
                if reference.number != instance.number and span is not None:
                    pair = (instance, state), (reference, reference_state)
                    view = self._stored(related, *pair, span) or self._boxes(related, *pair, span)
                    views += [view] if view else []
            if views:
                found.append((instance, state, tuple(views)))
        return found

    def _stored(self, related, candidate, reference, span):  # type: ignore[no-untyped-def]
        for form in STORED_FORMS[related.name]:
            subject, obj = (reference[0], candidate[0]) if form.turned else (candidate[0], reference[0])
            for edge in self.edges:
                if (edge.subject, edge.relation, edge.object) != (subject.number, form.relation, obj.number):
                    continue
                if span.overlaps(edge.since_ns, edge.until_ns) and not (
                    form.checked and not holds(related.name, _thing(*candidate), _thing(*reference))
                ):
                    stored_as = f"{edge.relation}({self.ids[subject.number]}, {self.ids[obj.number]})"
                    return candidate[0].id, reference[0].id, stored_as, edge.since_ns, edge.until_ns
        return None

    def _boxes(self, related, candidate, reference, span):  # type: ignore[no-untyped-def]
        if not holds(related.name, _thing(*candidate), _thing(*reference)):
            return None
        until_ns = None if span.high_ns == float("inf") else int(span.high_ns)
        return (
            candidate[0].id,
            reference[0].id,
            None,
            max(candidate[1].first_seen_ns, reference[1].first_seen_ns),
            until_ns,
        )

    def _out_of_reach(self, phrase: NounPhrase, related: RelationPhrase) -> list[tuple[str, float | None]]:
        pairs = sorted(
            (box_distance_m(state.box, reference_state.box), instance.number, instance.id)
            for instance in self._labelled(phrase)
            for state in self.selector.states(instance)[-1:]
            for reference, reference_state, _ in self._find(related.reference, as_reference=False)
            if reference.number != instance.number
        )
        nearest: dict[str, float | None] = {}
        for distance_m, _, text_id in pairs:
            nearest.setdefault(text_id, round(distance_m, 4))
        return list(nearest.items())[:3]

    def _doubted(self, noun: str) -> list[str]:
        """The ids of instances of that label that are believed in no more: those seen last."""
        doubted = [instance for instance in self.everything if instance.presence == "doubted"]
        labels = match_labels(Named(noun, noun), {instance.label for instance in doubted}, LEXICON).labels
        named = [instance for instance in doubted if instance.label in labels]
        named.sort(key=lambda instance: (-instance.last_seen_ns, -instance.number))
        return [each.id for each in sorted(named[:3], key=lambda instance: instance.number) if each.states]

    def _maybe_labelled(self, noun: str) -> list[str]:
        names = {noun} | LEXICON.synonyms(noun)
        maybe = [
            (-share, instance.number, instance.id)
            for instance in self.believed
            for label, share in instance.label_belief.items()
            if share >= 0.1 and LEXICON.normalise(label) in names and instance.states
        ]
        close = get_close_matches(noun, sorted({instance.label for instance in self.believed}), 1, 0.75)
        spelt = [instance.id for instance in self.believed if instance.label in close and instance.states]
        return ([text_id for _, _, text_id in sorted(maybe)] + spelt)[:3]

    def _unknown_noun(self, phrase: NounPhrase) -> str | None:
        if phrase.noun is not None and not self._labelled(phrase):
            return phrase.noun
        return None if phrase.relation is None else self._unknown_noun(phrase.relation.reference)

    def _by_id(self, noun: str) -> StoredInstance | None:
        instance = self.parts.get(noun)
        return instance if instance is not None and instance.presence != "doubted" else None

    def _labelled(self, phrase: NounPhrase) -> list[StoredInstance]:
        if phrase.noun is None:
            return list(self.believed)
        if (named := self._by_id(phrase.noun)) is not None:
            return [named]
        wanted = self._labels(phrase.noun)
        return [
            instance
            for instance in self.believed
            if ({instance.label} | {state.label for state in instance.states}) & wanted
        ]

    def _labels(self, noun: str) -> frozenset[str]:
        labels = {instance.label for instance in self.believed}
        labels |= {state.label for instance in self.believed for state in instance.states}
        return match_labels(Named(noun, noun), labels, LEXICON).labels


def _thing(instance: StoredInstance, state: StateRecord) -> GraphNode:
    """An instance in one of its states: of these memories, whose voxels lie anywhere, only the boxes are known."""
    label = instance.label if state is instance.states[-1] else state.label
    return GraphNode(instance.number, label, state.box, np.zeros((0, 3)))
