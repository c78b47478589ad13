"""From a question to its answer: parsed into a typed question, which a module for its kind answers from the map."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from importlib import import_module

from supermap_cli.errors import QueryError
from supermap_cli.language.known_names import KnownNames
from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.parsing import parse
from supermap_cli.language.questions import (
    Anything,
    Body,
    Changes,
    CompareCounts,
    CompareMeasure,
    Count,
    Describe,
    Exists,
    Find,
    Happened,
    Holds,
    HowFar,
    Measure,
    MostOf,
    MovedWhere,
    Question,
    Superlative,
    Things,
    When,
)
from supermap_cli.language.refusals import RefusedQuestionError
from supermap_cli.language.times import AtClock, AtEvent, Earlier, First, Last, Now
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answering.asking import Asking, Trace
from supermap_cli.query.answering.document import Answer, AskedRelation, Explanation, NearMiss, Reply
from supermap_cli.query.answering.explaining import tree_text
from supermap_cli.query.answering.phrases import listing, with_article
from supermap_cli.query.answering.things import ThingsFinder, conditions_of
from supermap_cli.query.answering.times import MomentSpan, QuestionTimes
from supermap_cli.query.clock import clock_of, is_time_of_day
from supermap_cli.query.retention_policy import pruned_evidence_notes
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.query.time_selector import TimeSelector, selector_at
from supermap_cli.query.views import DEFAULT_LIMIT, InstanceView
from supermap_cli.relations.map_relations import relations_of_configs

MAX_LOOSE_WORDS = 3
"""Unknown words that one question may have with `loose`."""

__all__ = ["Answer", "AskedRelation", "NearMiss", "answer", "answer_question", "known_names"]


def answer(
    text: str,
    reader: MapReader,
    at: str | None = None,
    limit: int = DEFAULT_LIMIT,
    *,
    language: str | None = None,
    explain: bool = False,
    loose: bool = False,
) -> Answer:
    """Answer a question, listing at most `limit` instances. `at` asks it as of a time or a traversal; `language` is an
    ISO 639-1 code; `explain` adds how the answer came about; with `loose` an unknown word is read as the known one
    that it is most like.

    Raises `QueryError` if the question is not understood, or has its own time besides `at`.
    """
    known = known_names(reader)
    try:
        question = _parsed_loosely(text, known, language) if loose else parse(text, known, language)
    except RefusedQuestionError as refusal:
        from supermap_cli.query.unseen_words import with_suggestions  # noqa: PLC0415 - loads the plugins

        raise with_suggestions(refusal, known.labels) from None
    return answer_question(question, reader, at, limit, explain=explain)


def _parsed_loosely(text: str, known: KnownNames, language: str | None) -> Question:
    """The question with each unknown word read as the known one that it is most like, one after the other: in spelling,
    else by an encoder of texts.
    """
    read, taken = text, list[tuple[str, str]]()
    while True:
        try:
            question = parse(read, known, language)
        except RefusedQuestionError as refusal:
            from supermap_cli.query.unseen_words import suggested_labels  # noqa: PLC0415 - loads the plugins

            near = refusal.near or suggested_labels(refusal, known.labels)
            if not near or len(taken) == MAX_LOOSE_WORDS:
                raise
            word = re.compile(rf"\b{re.escape(refusal.part or '')}\b", re.IGNORECASE)
            read, before = word.sub(near[0], read), read
            if read == before:
                raise
            taken.append((refusal.part or "", near[0]))
        else:
            return replace(question, text=text, mended=(*question.mended, *taken))


def known_names(reader: MapReader) -> KnownNames:
    """The names of a map that a question may use."""
    registry = relations_of_configs(traversal.config for traversal in reader.traversals)[0]
    return KnownNames(
        labels=reader.search.labels() | reader.search.doubted_labels(),
        traversals=[traversal.name for traversal in reader.traversals],
        relations={"en": dict(registry.phrases("en"))},
    )


def answer_question(
    question: Question, reader: MapReader, at: str | None = None, limit: int = DEFAULT_LIMIT, *, explain: bool = False
) -> Answer:
    """Answer a typed question. Raises `QueryError` for a time, traversal or viewpoint that the map does not have."""
    clock = clock_of(reader)
    asking = Asking(reader, clock, load_lexicon("en"), limit, Trace() if explain else None)
    asking.times = QuestionTimes(reader, clock, lambda asked: _event_span(asking, asked))
    if at is not None and question.time is not None:
        raise QueryError(
            "the question names a time of its own", where=question.text, cure="leave out --at, or the words"
        )
    selector = _selector(asking, question, at)
    finder = ThingsFinder(asking, selector, question.time)
    written = at or (question.time.written if isinstance(question.time, AtClock) else "")
    asking.note(*(f"'{written}' was read as '{meant}'" for written, meant in question.mended))
    _add_time_notes(asking, selector, written)
    reply = _reply(finder, _first_or_last_of_all(question), selector.text)
    _note_departures(asking, selector, reply.instances, written)
    asking.note(*pruned_evidence_notes((instance.evidence for instance in reply.instances), clock))
    loosely = bool(asking.loosely) and reply.verdict == "yes"
    return Answer(
        query=question.text,
        intent=reply.intent,
        time=selector.text,
        message=_loose_text(asking) + (reply.message.replace("Yes", "Perhaps", 1) if loosely else reply.message),
        notes=tuple(dict.fromkeys(asking.notes)),
        instances=reply.instances[:limit],
        relation=reply.relation,
        nearest=reply.nearest,
        more=reply.more if reply.more is None else reply.more + len(reply.instances[limit:]),
        count=reply.count,
        count_at_most=reply.count_at_most,
        verdict="unknown" if loosely else reply.verdict,
        measures=reply.measures or None,
        changes=reply.changes or None,
        readings=(_in_english(question.others) if question.others else None),
        explanation=None if asking.trace is None else _explanation(question, asking.trace),
    )


def _reply(finder: ThingsFinder, question: Question, when_text: str) -> Reply:
    """The answer of the module for this kind of question, which is imported now: a process asks one question mostly."""
    body = question.body
    module, name = _HANDLERS[type(body)]
    handler: Callable[..., Reply] = getattr(import_module(f"supermap_cli.query.answering.{module}"), name)
    return handler(finder, body, question.time if isinstance(body, Changes) else when_text)


_HANDLERS: Mapping[type, tuple[str, str]] = {
    Find: ("finding", "find"),
    Count: ("finding", "count"),
    Exists: ("finding", "exists"),
    Holds: ("holding", "holds"),
    MostOf: ("comparing", "most_of"),
    CompareCounts: ("comparing", "compare_counts"),
    CompareMeasure: ("comparing", "compare_measure"),
    HowFar: ("comparing", "how_far"),
    Describe: ("describing", "describe"),
    When: ("dating", "when"),
    Changes: ("changing", "changes"),
    MovedWhere: ("changing", "moved_where"),
}
"""The module and the function for each kind of question; each takes a finder, the question, and the time in words (that
of changes as it was asked).
"""


def _first_or_last_of_all(question: Question) -> Question:
    """The question; "what did you see first" asks for the one thing that was seen first."""
    match question:
        case Question(body=Find(Things(Anything(), (), None, None, None, None)), time=First() | Last()):
            measure: Measure = "old" if isinstance(question.time, First) else "seen"
            things = Things(Anything(), superlative=Superlative(measure))
            return replace(question, body=Find(things))
        case _:
            return question


def _event_span(asking: Asking, asked: AtEvent) -> MomentSpan:
    from supermap_cli.query.answering.events import event_span  # noqa: PLC0415 - few questions name an event

    return event_span(asking, asked)


def _in_english(bodies: Iterable[Body]) -> tuple[str, ...]:
    from supermap_cli.language.english import body_in_english  # noqa: PLC0415 - few questions have further readings

    return tuple(map(body_in_english, bodies))


def _selector(asking: Asking, question: Question, at: str | None) -> TimeSelector:
    """The states that the question is about. Changes and dates look at all states, and take their time themselves."""
    if at is not None:
        if isinstance(question.body, Changes | MovedWhere | When):
            cure = "name the time in the question: 'what changed since monday'"
            raise QueryError("a question about changes or dates is asked of the whole map", cure=cure)
        return selector_at(parse_time_point(at, asking.reader, asking.clock))
    if isinstance(question.body, Changes | MovedWhere):
        return TimeSelector("last", "last")
    if isinstance(question.body, When) and isinstance(question.time, None | First | Last | Now | Earlier):
        return TimeSelector("last", "last")
    if question.time is None and _asks_what_happened(question.body):
        return TimeSelector("last", "last")
    return asking.times.selector(question.time, past=question.past)


def _asks_what_happened(body: Body) -> bool:
    """Whether things are asked for by what happened to them: some of them are gone."""
    things = getattr(body, "things", None)
    conditions = () if things is None else conditions_of(things)
    return any(isinstance(condition, Happened) for condition in conditions)


def _add_time_notes(asking: Asking, selector: TimeSelector, written: str) -> None:
    """Add notes on how the time was understood, and on a time outside of the map."""
    asking.note(selector.note)
    if selector.kind != "at":
        return
    stamp_ns = int(selector.low_ns)
    if is_time_of_day(written):
        asking.note(f"{written} was taken as {asking.clock.text(stamp_ns)}")
    end_ns = max((traversal.end_ns for traversal in asking.reader.traversals), default=None)
    if end_ns is not None and stamp_ns < asking.clock.origin_ns:
        asking.note(f"the map begins at {asking.clock.text(asking.clock.origin_ns)}")
    elif end_ns is not None and stamp_ns > end_ns:
        asking.note(f"the map ends at {asking.clock.text(end_ns)}; what came after, nobody saw")


def _note_departures(asking: Asking, selector: TimeSelector, instances: Iterable[InstanceView], written: str) -> None:
    """Add a note for each matched or reference instance that left in a gap around the time."""
    if selector.kind != "at":
        return
    involved = [
        text_id
        for instance in instances
        for text_id in (instance.id, *(relation.object for relation in instance.relations))
    ]
    for text_id in dict.fromkeys(involved):
        instance = asking.instance(text_id)
        if instance is not None and (gap := selector.departure_gap(instance)) is not None:
            then = written or asking.clock.text(int(selector.low_ns))
            asking.note(f"{text_id} left {asking.clock.between(*gap)}; nobody can say for {then}")


def _loose_text(asking: Asking) -> str:
    """Says first which nouns name nothing in the map, and what was taken instead."""
    return "".join(
        f"Nothing in the map is called {with_article(name)}; what is called "
        f"{listing([with_article(label) for label in sorted(labels)], 'or')} was taken instead. "
        for name, labels in asking.loosely.items()
    )


def _explanation(question: Question, trace: Trace) -> Explanation:
    from supermap_cli.language.english import question_in_english  # noqa: PLC0415 - only for --explain

    time = "" if question.time is None else f", {tree_text(question.time)}"
    tree = f"{tree_text(question.body)}{time}"
    return Explanation(question_in_english(question), tree, tuple(trace.decisions.values()))
