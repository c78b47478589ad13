"""English for parts of a question and of its answer: numbers, plurals, lists, noun phrases and conditions."""

from __future__ import annotations

from collections.abc import Sequence

from supermap_cli.language.questions import (
    And,
    Between,
    Colour,
    Condition,
    Directed,
    Distant,
    Except,
    Happened,
    Having,
    Identified,
    MadeOf,
    Not,
    Noun,
    Or,
    Related,
    Robot,
    SeenFrom,
    Size,
    Superlative,
    Things,
    Union,
)
from supermap_cli.query.answering.nouns import noun_text

NUMBERS = (*("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"),)
_IRREGULAR = {
    "person": "people",
    "man": "men",
    "woman": "women",
    "child": "children",
    "mouse": "mice",
    "knife": "knives",
    "shelf": "shelves",
    "bookshelf": "bookshelves",
    "scissors": "scissors",
    "stairs": "stairs",
    "sheep": "sheep",
}
WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
MASS_NOUNS = frozenset(
    {
        *("furniture", "electronics", "luggage", "baggage", "cutlery", "crockery", "tableware", "clothing", "bedding"),
        *("food", "equipment", "stationery", "glassware", "kitchenware", "cookware", "silverware", "footwear"),
    }
)
"""Nouns of classes that are counted in pieces."""
_PAST = {"is": "was", "are": "were", "stands": "stood", "stand": "stood"}
_RANK_WORDS = {1: "", 2: "second ", 3: "third ", 4: "fourth ", 5: "fifth "}
_SUPERLATIVES = {
    "near": "closest",
    "far": "farthest",
    "large": "largest",
    "small": "smallest",
    "tall": "tallest",
    "low": "lowest",
    "wide": "widest",
    "narrow": "narrowest",
    "new": "newest",
    "old": "first seen",
    "seen": "most recently seen",
}
EVENT_VERBS = {
    "appeared": "appeared",
    "disappeared": "disappeared",
    "moved": "moved",
    "changed": "changed",
    "returned": "came back",
    "seen": "were seen",
}
PARTICIPLES = EVENT_VERBS | {"returned": "come back", "seen": "been seen"}


def number_text(number: int) -> str:
    """A small number in words, a large one in digits."""
    return NUMBERS[number] if number < len(NUMBERS) else str(number)


def plural(noun: str) -> str:
    """The plural of an English noun phrase: its head is its last word, or the one before "of", "to"; of several joined
    by "or", that of each.
    """
    if " or " in noun:
        return " or ".join(map(plural, noun.split(" or ")))
    for joint in (" of ", " to "):
        head, found, rest = noun.partition(joint)
        if found:
            return plural(head) + joint + rest
    *before, last = noun.split(" ")
    return " ".join([*before, _plural_word(last)])


def counted(number: int, noun: str) -> str:
    """A number of things: "two cups", "one cup", "no cups"."""
    if noun.rsplit(" ", 1)[-1] in MASS_NOUNS:
        return f"{number_text(number)} {'piece' if number == 1 else 'pieces'} of {noun}"
    return f"{number_text(number)} {noun if number == 1 else plural(noun)}"


def listing(parts: Sequence[str], joint: str = "and") -> str:
    """Words in a row: "a, b and c"."""
    if len(parts) < 2:
        return "".join(parts)
    return f"{', '.join(parts[:-1])} {joint} {parts[-1]}"


def short_list(ids: Sequence[str], most: int) -> str:
    """The first few of some ids."""
    return listing(ids) if len(ids) <= most else f"{', '.join(ids[:most])} and {len(ids) - most} more"


def verb(stem: str, number: int, *, past: bool) -> str:
    """A form of "is" or "stand", in number and tense."""
    form = {"is": "is" if number == 1 else "are", "stand": "stands" if number == 1 else "stand"}[stem]
    return _PAST[form] if past else form


def capitalised(sentence: str) -> str:
    """A sentence with a capital letter in front, unless it begins with an id."""
    first = sentence.split(" ", maxsplit=1)[0]
    return sentence if any(letter.isdigit() for letter in first) else sentence[:1].upper() + sentence[1:]


def lowered(sentence: str) -> str:
    """A sentence that goes on after "Yes:": without its capital letter."""
    first = sentence.split(" ", maxsplit=1)[0]
    return sentence if any(letter.isdigit() for letter in first) else sentence[:1].lower() + sentence[1:]


def time_phrase(when: str) -> str:
    """The time of an answer as it follows its sentence; "now" is not said."""
    names_day = when.startswith("in ") and when[3:].casefold() in WEEKDAYS
    told = {"now": "", "last": " when last seen", "first": " when first seen"}
    return told.get(when, f" on {when[3:]}" if names_day else f" {when}")


def with_article(noun: str) -> str:
    """A noun with its indefinite article."""
    if noun.rsplit(" ", 1)[-1] in MASS_NOUNS:
        return noun
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def head_text(things: Things) -> str:
    """What things are called, with their attributes, in the singular: "red chair"."""
    words = [_attribute_text(attribute) for attribute in things.attributes]
    return " ".join([*words, _noun(things.noun)])


def things_text(things: Things, *, article: bool = True) -> str:
    """A whole noun phrase: "a red chair near tv-1"."""
    noun = head_text(things)
    if isinstance(things.noun, Identified | Robot | Union) or not article:
        text = noun
    elif things.superlative is not None:
        text = f"the {superlative_text(things.superlative)} {noun}"
    elif things.quantity in {"all", "every", "both"}:
        text = f"{things.quantity} {noun if things.quantity == 'every' else plural(noun)}"
    elif things.number is not None:
        text = counted(things.number, noun)
    else:
        text = "anything" if noun == "thing" else with_article(noun)
    return text if things.condition is None else f"{text} {condition_text(things.condition)}"


def superlative_text(superlative: Superlative) -> str:
    """A superlative without its reference: "second closest"."""
    rank = _RANK_WORDS.get(superlative.rank, f"{superlative.rank}th ")
    return f"{rank}{_SUPERLATIVES[superlative.measure]}"


def condition_text(condition: Condition) -> str:  # noqa: C901, PLR0911, PLR0912 - one case a kind of condition
    """A condition as it follows a noun."""
    match condition:
        case Related(relation, reference, inverse):
            return f"with {things_text(reference)} {relation} it" if inverse else f"{relation} {things_text(reference)}"
        case Having(attribute):
            return _attribute_text(attribute)
        case Directed(direction, reference, viewpoint):
            seen = {None: ""}.get(viewpoint) if viewpoint is None else _viewpoint_text(viewpoint)
            return f"{direction} {things_text(reference)}{seen}"
        case Between(first, second):
            both = plural(head_text(first)) if second is None else f"{things_text(first)} and {things_text(second)}"
            return f"between {both}"
        case Distant(metres, farther, reference):
            to = "the robot" if reference is None else things_text(reference)
            return f"{'more than' if farther else 'within'} {metres:g} m {'from' if farther else 'of'} {to}"
        case Happened(event, _):
            return f"that {EVENT_VERBS[event]}"
        case Not(Related(relation, reference, True)):
            return f"without {things_text(reference)} {relation} it"
        case Not(Or((Related("on", reference, True), *_, Related("at", _, True)))):
            return f"without {things_text(reference)} on, in or at it"
        case Or((Related("on", reference, True), *_, Related("at", _, True))):
            return f"with {things_text(reference)} on, in or at it"
        case Not(negated):
            return f"not {condition_text(negated)}"
        case Except(things):
            return f"except {things_text(things)}"
        case And(conditions):
            return " and ".join(map(condition_text, conditions))
        case Or(conditions):
            return " or ".join(map(condition_text, conditions))


def _viewpoint_text(viewpoint: Robot | SeenFrom) -> str:
    if isinstance(viewpoint, Robot):
        return ", seen from the robot's last place"
    return f", seen from {things_text(viewpoint.things)}"


def _noun(noun: Noun) -> str:
    if isinstance(noun, Union):
        return " or ".join(head_text(member) for member in noun.members)
    return noun_text(noun)


def _attribute_text(attribute: Colour | Size | MadeOf) -> str:
    match attribute:
        case Colour(name):
            return name
        case Size(word):
            return word
        case MadeOf(name):
            return {"wood": "wooden"}.get(name, name)


def _plural_word(word: str) -> str:
    if word in MASS_NOUNS:
        return word
    if word in _IRREGULAR:
        return _IRREGULAR[word]
    if word.endswith(("s", "x", "ch", "sh")):
        return f"{word}es"
    if word.endswith("y") and word[-2:-1] not in "aeiou":
        return f"{word[:-1]}ies"
    return f"{word}s"
