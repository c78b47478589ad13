"""Whether something is so, and whether it is so still: yes, no, or unknown, with the evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from supermap_cli.language.questions import Anything, Condition, Holds, Or, Related, Things, Union
from supermap_cli.memory.values import StoredInstance
from supermap_cli.query.answering.conditions import ConditionJudge, Judgement
from supermap_cli.query.answering.document import Reply, Truth
from supermap_cli.query.answering.finding import clause_text, is_carrying, missing_sentence, unsure_text
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.phrases import condition_text, listing, lowered, time_phrase, verb
from supermap_cli.query.answering.places import place_of
from supermap_cli.query.answering.sources import Candidates
from supermap_cli.query.answering.things import ThingsFinder
from supermap_cli.query.candidates import InstanceCandidate
from supermap_cli.query.change_classification import MIN_MOVE_M, state_distance_m
from supermap_cli.query.time_selector import TimeSelector

MAX_TOLD = 8
"""Things that one sentence tells of."""
_LEADS: dict[Truth, str] = {"yes": "Yes: ", "no": "No: ", "unknown": "Nobody can say: "}


def holds(finder: ThingsFinder, question: Holds, when: str) -> Reply:
    """Whether a condition holds of things; whether things are still there, or a condition still holds."""
    if question.still:
        return _still(finder, question)
    if question.condition is None:
        return _is_there(finder, question.things, when)
    if isinstance(question.things.noun, Union) and question.things.noun.every:
        return _of_each(finder, question, question.things.noun.members, when)
    if question.things.quantity == "only":
        return _only(finder, question, when)
    judgements = _judged(finder, question)
    lister = Lister(finder)
    if not judgements:
        nearest = lister.nearest(question.things)
        missing = missing_sentence(finder, question.things, nearest, when)
        unknown = lister.unknown_noun(question.things) is None and any(
            miss.presence == "absent" and "gone" not in miss.reason for miss in nearest
        )
        verdict: Truth = "unknown" if unknown else "no"
        return Reply("holds", _LEADS[verdict] + lowered(missing), (), nearest, verdict=verdict)
    return _weighed(lister, question, judgements, when)


def _of_each(finder: ThingsFinder, question: Holds, members: Sequence[Things], when: str) -> Reply:
    """Whether a condition holds of each of several things: "are the mug and the vase on the desk"."""
    replies = [holds(finder, replace(question, things=member), when) for member in members]
    verdicts = {reply.verdict for reply in replies}
    verdict: Truth = "no" if "no" in verdicts else "unknown" if "unknown" in verdicts else "yes"
    told = [reply.message.removeprefix(_LEADS[reply.verdict or "unknown"]).removesuffix(".") for reply in replies]
    return Reply(
        "holds",
        f"{_LEADS[verdict]}{'; '.join(told)}.",
        tuple(view for reply in replies for view in reply.instances),
        tuple(miss for reply in replies for miss in reply.nearest),
        replies[0].relation,
        verdict=verdict,
    )


def _weighed(lister: Lister, question: Holds, judgements: list[Judgement], when: str) -> Reply:
    """The verdict over all things of the phrase: all of them with "all" and "both", else any."""
    assert question.condition is not None  # noqa: S101 - its caller has asked
    finder, related = lister.finder, replace(question.things, condition=question.condition)
    yes, no, unsure = ([each for each in judgements if each.verdict == kind] for kind in ("yes", "no", "unsure"))
    every = question.things.quantity in {"all", "every", "both"}
    if question.things.quantity == "no":
        verdict: Truth = "no" if yes else "unknown" if unsure else "yes"
    elif every:
        verdict = "no" if no else "unknown" if unsure else "yes"
    else:
        verdict = "yes" if yes else "unknown" if unsure else "no"
    condition = condition_text(question.condition)
    past = finder.selector.kind != "now"
    parts = []
    if yes:
        ids = listing([each.candidate.instance.id for each in yes[:MAX_TOLD]])
        parts.append(f"{ids} {_so(question.condition, len(yes), past=past)}{_detail(yes)}")
    if no and (every or not yes):
        ids = listing([each.candidate.instance.id for each in no[:MAX_TOLD]])
        reason = f" ({no[0].reason})" if len(no) == 1 and no[0].reason != f"not {condition}" else ""
        parts.append(f"{ids} {verb('is', len(no), past=past)} not {condition}{reason}")
    nearest = () if yes else lister.nearest(related)
    reasons = "; ".join(f"{miss.id}: {miss.reason}" for miss in nearest if miss.distance_m is not None)
    when_text = "" if when in {"now", "last"} else f",{time_phrase(when)}"
    sentence = f"{'; '.join(parts)}{when_text}{f' ({reasons})' if reasons else ''}." if parts else ""
    message = f"{_LEADS[verdict].rstrip()} {sentence}".rstrip() if sentence else ""
    listed = yes or ([] if verdict == "no" else unsure)
    return Reply(
        "holds",
        (message + (unsure_text(unsure) if verdict == "unknown" else "")).strip(),
        lister.views(each.candidate for each in listed),
        nearest,
        lister.asked_relation(related),
        verdict=verdict,
    )


def _judged(finder: ThingsFinder, question: Holds) -> list[Judgement]:
    """The things of the phrase judged by the condition: the newest state of each."""
    assert question.condition is not None  # noqa: S101 - its caller has asked
    candidates = finder.all_candidates(question.things)
    judge = ConditionJudge(finder, finder.named(question.things.noun), question.things.noun)
    return judge.all_of([question.condition], candidates) if candidates else []


def _so(condition: Condition, number: int, *, past: bool) -> str:
    """What is so of things: "is on a desk", "has a monitor on it"."""
    if isinstance(condition, Related | Or) and is_carrying(condition):
        return clause_text(condition, number, past=past)
    return f"{verb('is', number, past=past)} {condition_text(condition)}"


def _detail(yes: Sequence[Judgement]) -> str:
    """The ids of the references, where they differ from the condition's words."""
    own = {each.candidate.instance.id for each in yes}
    ends = (end for each in yes for relation in each.candidate.relations for end in (relation.subject, relation.object))
    others = dict.fromkeys(end for end in ends if end != "robot" and end not in own)
    return f" ({listing(list(others)[:MAX_TOLD])})" if others else ""


def _is_there(finder: ThingsFinder, things: Things, when: str) -> Reply:
    """Whether things are there at all."""
    found, lister = finder.find(things), Lister(finder)
    views = lister.views(found.candidates)
    if views:
        return Reply("holds", f"Yes: {listing([view.id for view in views[:MAX_TOLD]])}.", views, verdict="yes")
    nearest = lister.nearest(things)
    verdict: Truth = "unknown" if any("not seen since" in miss.reason for miss in nearest) else "no"
    return Reply(
        "holds",
        _LEADS[verdict] + lowered(missing_sentence(finder, things, nearest, when)),
        (),
        nearest,
        verdict=verdict,
    )


def _only(finder: ThingsFinder, question: Holds, when: str) -> Reply:
    """Whether nothing but the things fulfils the condition."""
    assert question.condition is not None  # noqa: S101 - its caller has asked
    lister = Lister(finder)
    named = replace(question.things, quantity=None)
    these = finder.find(replace(named, condition=question.condition))
    others = finder.find(Things(Anything(), condition=question.condition))
    own = {candidate.instance.number for candidate in finder.all_candidates(named)}
    strangers = [candidate for candidate in others.candidates if candidate.instance.number not in own]
    condition = condition_text(question.condition)
    views = lister.views(these.candidates)
    if not views:
        nearest = lister.nearest(replace(named, condition=question.condition))
        missing = missing_sentence(finder, replace(named, condition=question.condition), nearest, when)
        return Reply("holds", f"No: {lowered(missing)}", (), nearest, verdict="no")
    if strangers:
        ids = listing([candidate.instance.id for candidate in strangers[:MAX_TOLD]])
        also = "is" if len(strangers) == 1 else "are"
        return Reply("holds", f"No: {ids} {also} {condition}, too.", lister.views(strangers), verdict="no")
    return Reply("holds", f"Yes: only {listing([view.id for view in views])}.", views, verdict="yes")


# -- still


def _still(finder: ThingsFinder, question: Holds) -> Reply:
    """Whether things that were there (in a relation) still are."""
    before = ThingsFinder(finder.asking, TimeSelector("earlier", "earlier", high_ns=finder.asking.times.earlier_ns))
    things = question.things
    known = _known_before(before, things, question)
    lister = Lister(finder)
    if not known:
        nearest = lister.nearest(things)
        unknown = lister.unknown_noun(things)
        if unknown is None and question.condition is not None:
            return holds(finder, replace(question, still=False), "now")
        missing = missing_sentence(finder, things, nearest, "now")
        verdict: Truth = "no" if unknown is not None else "unknown"
        return Reply("holds", _LEADS[verdict] + lowered(missing), (), nearest, verdict=verdict)
    if question.condition is not None:
        return _still_so(finder, question, known, lister)
    told = [_still_there(finder, candidate.instance) for candidate in known]
    verdicts = [verdict for verdict, _ in told]
    verdict = _overall(verdicts, every=things.quantity in {"all", "every", "both"})
    order = {verdict: 0}
    ranked = sorted(zip(told, known, strict=True), key=lambda pair: order.get(pair[0][0], 1))
    sentence = "; ".join(text for (_, text), _ in ranked[:MAX_TOLD])
    more = f"; and {len(ranked) - MAX_TOLD} more" if len(ranked) > MAX_TOLD else ""
    instances = [candidate.instance for (each, _), candidate in ranked if each == verdict or verdict != "yes"]
    return Reply("holds", f"{_LEADS[verdict]}{sentence}{more}.", lister.instances(instances), verdict=verdict)


def _known_before(before: ThingsFinder, things: Things, question: Holds) -> Candidates:
    """The things that were known earlier, fulfilling their condition; else those ever known."""
    phrase = things if question.condition is None else replace(things, condition=question.condition)
    found = before.all_candidates(phrase)
    if found or question.condition is not None:
        return found
    ever = ThingsFinder(before.asking, TimeSelector("last", "last"))
    return ever.all_candidates(things)


def _still_so(finder: ThingsFinder, question: Holds, known: Candidates, lister: Lister) -> Reply:
    """Whether a condition that held earlier holds now, of the same things."""
    assert question.condition is not None  # noqa: S101 - its caller has asked
    condition = condition_text(question.condition)
    now = [InstanceCandidate(each.instance, each.instance.states[-1]) for each in known
           if each.instance.presence == "present"]  # fmt: skip
    judge = ConditionJudge(finder, finder.named(question.things.noun), question.things.noun)
    judged = {each.candidate.instance.number: each for each in judge.all_of([question.condition], now)}
    told: list[tuple[Truth, str]] = []
    for candidate in known:
        judgement = judged.get(candidate.instance.number)
        if judgement is None:
            told.append(_still_there(finder, candidate.instance))
        elif judgement.verdict == "yes":
            told.append(("yes", f"{candidate.instance.id} is still {condition}{_detail([judgement])}"))
        elif judgement.verdict == "no":
            place = place_of(finder.asking, candidate.instance, candidate.instance.states[-1])
            told.append(("no", f"{candidate.instance.id} is not {condition} any more, but {place}"))
        else:
            told.append(("unknown", f"{candidate.instance.id}: {judgement.reason}"))
    verdict = _overall([each for each, _ in told], every=question.things.quantity in {"all", "every", "both"})
    sentence = "; ".join(text for _, text in told[:MAX_TOLD])
    instances = (candidate.instance for candidate in known)
    return Reply("holds", f"{_LEADS[verdict]}{sentence}.", lister.instances(instances), verdict=verdict)


def _still_there(finder: ThingsFinder, instance: StoredInstance) -> tuple[Truth, str]:
    """Whether an instance stands where it stood before the latest visit."""
    clock, state = finder.asking.clock, instance.states[-1]
    latest = finder.reader.traversals[-1]
    seen = clock.text(state.last_seen_ns)
    if instance.presence == "present":
        moved = [old for old in instance.states[:-1] if old.first_seen_ns < latest.start_ns]
        if moved and state_distance_m(moved[-1], state) >= MIN_MOVE_M and state.first_seen_ns >= latest.start_ns:
            place, metres = place_of(finder.asking, instance, state), state_distance_m(moved[-1], state)
            return "no", f"{instance.id} has moved {metres:.2f} m and stands {place} now, seen {seen}"
        if state.last_seen_ns >= latest.start_ns:
            return "yes", f"{instance.id} is still there, {place_of(finder.asking, instance, state)}, seen {seen}"
        return "unknown", f"{instance.id} was last seen {seen}, and nobody has looked at its place since"
    if state.gone_ns is not None:
        return "no", f"{instance.id} is gone: it left {clock.between(state.last_seen_ns, state.gone_ns)}"
    return "unknown", f"{instance.id} was last seen {seen}, not seen since, and its place was never seen empty"


def _overall(verdicts: Sequence[Truth], *, every: bool) -> Truth:
    if every:
        return "no" if "no" in verdicts else "unknown" if "unknown" in verdicts else "yes"
    return "yes" if "yes" in verdicts else "unknown" if "unknown" in verdicts else "no"
