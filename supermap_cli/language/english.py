"""A typed question as an English sentence that is parsed to the same typed question again.

It tells people how their question was understood. A noun phrase that restricts another one, and alternatives within a
list of conditions, stand in parentheses, so that nothing is ambiguous.
"""

from __future__ import annotations

from supermap_cli.language import questions as tree
from supermap_cli.language.english_times import time_in_english
from supermap_cli.language.times import Event

_SUPERLATIVES: dict[tree.Measure, str] = {
    "near": "closest",
    "far": "farthest",
    "large": "largest",
    "small": "smallest",
    "tall": "tallest",
    "low": "lowest",
    "wide": "widest",
    "narrow": "narrowest",
    "new": "newest",
    "old": "oldest",
    "seen": "most recently seen",
}
_COMPARATIVES: dict[tree.Measure, str] = {
    "near": "closer",
    "far": "farther",
    "large": "larger",
    "small": "smaller",
    "tall": "taller",
    "low": "shorter",
    "wide": "wider",
    "narrow": "narrower",
    "new": "newer",
    "old": "older",
    "seen": "newer",
}
_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth")
_PAST: dict[Event, str] = {
    "appeared": "appeared",
    "disappeared": "disappeared",
    "moved": "moved",
    "changed": "changed",
    "returned": "returned",
    "seen": "seen",
}
_BASE: dict[Event, str] = {
    "appeared": "appear",
    "disappeared": "disappear",
    "moved": "move",
    "changed": "change",
    "returned": "return",
}
_PARTICIPLE: dict[Event, str] = {**_PAST, "appeared": "appeared"}


def question_in_english(question: tree.Question) -> str:
    """The question, its time included, as one sentence."""
    body = body_in_english(question.body)
    return body if question.time is None else f"{body} {time_in_english(question.time, bare_in_english)}"


def body_in_english(body: tree.Body) -> str:  # noqa: C901, PLR0911, PLR0912 - one case a kind of question
    """What is asked, without its time."""
    match body:
        case tree.Find(things, place):
            return f"where is {things_in_english(things)}" if place else f"find {things_in_english(things)}"
        case tree.Count(things):
            return f"how many {things_in_english(things, plural=True)}"
        case tree.Exists(things):
            return f"is there {things_in_english(things)}"
        case tree.Holds(things, condition, still):
            if condition is None or still:
                return f"is {bare_in_english(things)} still there"
            happened = isinstance(condition, tree.Happened)  # in parentheses, a time after it is that of the question
            holds = _grouped(condition) if happened else condition_in_english(condition)
            return f"is {bare_in_english(things)} {holds}"
        case tree.MostOf(things, counted, relation, fewest):
            most = "fewest" if fewest else "most"
            subject, others = bare_in_english(things), bare_in_english(counted, plural=True)
            return f"which {subject} has the {most} {others} {_phrase(relation)} it"
        case tree.CompareCounts(first, second, equal=True):
            return f"are there as many {bare_in_english(first, plural=True)} as {bare_in_english(second, plural=True)}"
        case tree.CompareCounts(first, second, fewer):
            more = "fewer" if fewer else "more"
            return f"are there {more} {bare_in_english(first, plural=True)} than {bare_in_english(second, plural=True)}"
        case tree.CompareMeasure(measure, first, second, to):
            reference = "" if to is None else f" to {bare_in_english(to)}"
            compared = f"{_COMPARATIVES[measure]}{reference}"
            return f"is {bare_in_english(first)} {compared} than {bare_in_english(second)}"
        case tree.HowFar(first, second):
            return f"how far is {bare_in_english(first)} from {_reference_in_english(second)}"
        case tree.Describe(things, what):
            return _describing(bare_in_english(things), what)
        case tree.When():
            return _when(body)
        case tree.Changes():
            return _changes(body)
        case tree.MovedWhere(things, what):
            return f"where did {bare_in_english(things)} {'come from' if what == 'from' else 'go'}"


def _describing(things: str, what: str) -> str:
    match what:
        case "colour" | "size" | "height" | "width":
            return f"what {what} is {things}"
        case "confidence":
            return f"how sure are you about {things}"
        case _:
            return f"describe {things}"


def _when(body: tree.When) -> str:  # noqa: PLR0911 - one case a kind
    things = bare_in_english(body.things)
    match body.what, body.event:
        case "at", "seen":
            return f"when was {things} seen"
        case "at", event:
            return f"when did {things} {_BASE[event]}"
        case "how often", "seen":
            return f"how often was {things} seen"
        case "how often", event:
            return f"how often did {things} {_BASE[event]}"
        case "how long", _:
            return f"how long was {things} there"
        case "since", _:
            return f"since when is {things} there"
        case _:
            return f"until when was {things} there"


def _changes(body: tree.Changes) -> str:
    events = body.events or ("changed",)
    if body.exists:
        things = "anything" if body.things is None else bare_in_english(body.things)
        return f"did {things} {' or '.join(_BASE[event] for event in events)}"
    happened = " or ".join(_PAST[event] for event in events)
    if body.count:
        return f"how many {bare_in_english(body.things or _ANYTHING, plural=True)} {happened}"
    return f"what {happened}" if body.things is None else f"which {bare_in_english(body.things)} {happened}"


# --- Noun phrases ---

_ANYTHING = tree.Things(tree.Anything())


def things_in_english(things: tree.Things, *, plural: bool = False) -> str:
    """A noun phrase with its conditions."""
    plain, excepted = _without_exceptions(things.condition)
    phrase = _plain_phrase(things, plural=plural)
    if plain is not None:
        happened = isinstance(plain, tree.Happened)  # in parentheses, a time after it is that of the question
        phrase = f"{phrase} {_grouped(plain) if happened else condition_in_english(plain)}"
    return phrase if excepted is None else f"{phrase} except {bare_in_english(excepted)}"


def bare_in_english(things: tree.Things, *, plural: bool = False) -> str:
    """A noun phrase, in parentheses where it has conditions or several members."""
    whole = things_in_english(things, plural=plural)
    superlative = things.superlative is not None and things.superlative.to is not None
    return f"({whole})" if things.condition is not None or superlative else whole


def _reference_in_english(things: tree.Things | None) -> str:
    return "you" if things is None else bare_in_english(things)


def _plain_phrase(things: tree.Things, *, plural: bool) -> str:
    plural = plural or things.quantity in {"all", "both"} or (things.number or 1) > 1
    words: list[str] = []
    if things.quantity is not None:
        words.append(things.quantity)
    if things.number is not None:
        words.append(str(things.number))
    superlative = things.superlative
    if superlative is not None:
        if superlative.rank > 1:
            words.append(_ORDINALS[superlative.rank - 1])
        words.append(_SUPERLATIVES[superlative.measure])
    words += [_attribute(attribute) for attribute in things.attributes]
    words.append(_noun(things.noun, plural=plural))
    if superlative is not None and superlative.to is not None:
        words += ["from" if superlative.measure == "far" else "to", bare_in_english(superlative.to)]
    return " ".join(words)


def _attribute(attribute: tree.Attribute) -> str:
    match attribute:
        case tree.Size(word):
            return word
        case tree.MadeOf("wood"):
            return "wooden"  # "wood mouse" is an animal
        case tree.Colour(name) | tree.MadeOf(name):
            return name


def _noun(noun: tree.Noun, *, plural: bool) -> str:  # noqa: PLR0911 - one case a kind of noun
    match noun:
        case tree.Anything():
            return "things" if plural else "thing"
        case tree.Named(name):
            return _plural(name) if plural else name
        case tree.Identified(id_):
            return id_
        case tree.Usable(use):
            return f"thing to {use}"
        case tree.Robot():
            return "you"
        case tree.Union(members, every):
            *firsts, last = (bare_in_english(member, plural=plural) for member in members)
            if not every:
                return f"({' or '.join([*firsts, last])})"
            return f"({', '.join(firsts)} and {last})"


def _plural(name: str) -> str:
    if name.endswith("s"):
        return name
    if name.endswith("y") and name[-2:-1] not in "aeiou":
        return f"{name[:-1]}ies"
    return f"{name}es" if name.endswith(("x", "z", "ch", "sh")) else f"{name}s"


# --- Conditions ---


def condition_in_english(condition: tree.Condition) -> str:  # noqa: C901, PLR0911, PLR0912 - one case a kind of condition
    """A condition as it follows a noun."""
    match condition:
        case tree.Related(relation, reference, inverse):
            if inverse:
                return f"with {bare_in_english(reference)} {_phrase(relation)} it"
            return f"{_phrase(relation)} {bare_in_english(reference)}"
        case tree.Having(attribute):
            return _attribute(attribute)
        case tree.Directed(direction, reference, viewpoint):
            return f"{direction} {bare_in_english(reference)}{_viewpoint(viewpoint)}"
        case tree.Between(first, second):
            if second is None:
                return f"between {bare_in_english(first, plural=True)}"
            return f"between {bare_in_english(first)} and {bare_in_english(second)}"
        case tree.Distant(metres, farther, reference):
            return f"{'more than' if farther else 'within'} {metres:.10g} m from {_reference_in_english(reference)}"
        case tree.Happened(event, when):
            moment = "" if when is None else f" {time_in_english(when, bare_in_english)}"
            return f"that has {'been ' if event == 'seen' else ''}{_PARTICIPLE[event]}{moment}"
        case tree.Not(inner):
            return f"not {_grouped(inner)}"
        case tree.Except(things):
            return f"except {bare_in_english(things)}"
        case tree.And(conditions):
            return " and ".join(_grouped(part) for part in conditions)
        case tree.Or((tree.Related("on", reference, True), *_, tree.Related("at", _, True))):
            return f"with {bare_in_english(reference)}"
        case tree.Or(conditions):
            return " or ".join(_grouped(part) for part in conditions)


def _grouped(condition: tree.Condition) -> str:
    """A condition within another one, in parentheses where it has parts itself."""
    whole = condition_in_english(condition)
    return f"({whole})" if isinstance(condition, (tree.And, tree.Or, tree.Not, tree.Happened)) else whole


def _viewpoint(viewpoint: tree.Viewpoint | None) -> str:
    match viewpoint:
        case None:
            return ""
        case tree.Robot():
            return " seen from you"
        case tree.SeenFrom(things):
            return f" seen from {bare_in_english(things)}"


def _without_exceptions(condition: tree.Condition | None) -> tuple[tree.Condition | None, tree.Things | None]:
    """A condition without the exception at its end, and that."""
    match condition:
        case tree.Except(things):
            return None, things
        case tree.And((*others, tree.Except(things))):
            return (others[0] if len(others) == 1 else tree.And(tuple(others))), things
    return condition, None


def _phrase(relation: str) -> str:
    """The words of a relation: its name in the registry is one of its phrases."""
    return relation.replace("_", " ")
