"""The typed tree of a question: what every language is parsed to, what is answered, and what is written as English.

A question is one of the types in `Body`, asked of a `Time`. It names `Things` (a noun with its attributes and the
conditions that restrict it); conditions relate them to other things and can be nested. Nothing here knows a map: nouns
are what the lexicon knows, ids and names of traversals are those the parser was given. All lengths are in metres, all
durations in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from supermap_cli.language.times import Event, Time

# --- Nouns ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Anything:
    """Any thing: "thing", "object", "what is on the desk"."""


@dataclass(frozen=True)
class Named:
    """What has a name: `name` in the singular and lower case, as the lexicon writes it in English ("office chair").

    `written` is the noun as it was typed, in the language of the question. `hypernym` is set for a word that stands for
    a class of things ("furniture", "kitchen appliance"): then any of its kinds is meant.
    """

    name: str
    written: str
    hypernym: bool = False


@dataclass(frozen=True)
class Identified:
    """One instance, by its id ("chair-1")."""

    id: str


@dataclass(frozen=True)
class Usable:
    """What serves a use class of the lexicon: "something to sit on" is `Usable("sit on")`."""

    use: str


@dataclass(frozen=True)
class Robot:
    """The robot at its last pose: "you", "me", "here"."""


@dataclass(frozen=True)
class Union:
    """What any of several noun phrases names: "chairs and tables", "a cup or a bottle".

    `every`: each of them is asked for, as "is there a cup and a bottle" is answered with yes only if there are both.
    """

    members: tuple[Things, ...]
    every: bool = False


Noun = Anything | Named | Identified | Usable | Robot | Union

# --- Attributes -------------------------------------------------------------------------------------------------------

SizeWord = Literal["big", "small", "tall", "low", "wide", "narrow"]


@dataclass(frozen=True)
class Colour:
    """A colour by one of the eleven basic colour terms of English (Berlin and Kay, 1969)."""

    name: Literal["black", "white", "grey", "red", "green", "blue", "yellow", "orange", "brown", "pink", "purple"]


@dataclass(frozen=True)
class Size:
    """Larger, or smaller, than the median of what the noun names in the map."""

    word: SizeWord


@dataclass(frozen=True)
class MadeOf:
    """A material that a label may carry ("wooden": "wood")."""

    name: str


Attribute = Colour | Size | MadeOf

# --- Things -----------------------------------------------------------------------------------------------------------

Quantity = Literal["all", "every", "both", "any", "only", "no"]
Measure = Literal["near", "far", "large", "small", "tall", "low", "wide", "narrow", "new", "old", "seen"]
"""What a superlative ranks by: the distance to a reference ("closest", "farthest"), the volume of the box, its height,
its longer horizontal side, the time of first seeing (new: newest first, old: oldest first), that of last seeing."""


@dataclass(frozen=True)
class Superlative:
    """The `rank`-th by a measure: "the second closest to the door" is near, 2, door. `to` is the reference of "near"
    and "far"; `None` is the robot at its last pose, which an answer says.
    """

    measure: Measure
    rank: int = 1
    to: Things | None = None


@dataclass(frozen=True)
class Things:
    """A noun phrase.

    `number` is a number of things ("two cups"), `quantity` a word for how many. `superlative` chooses one of those that
    fulfil `condition`.
    """

    noun: Noun
    attributes: tuple[Attribute, ...] = ()
    quantity: Quantity | None = None
    number: int | None = None
    superlative: Superlative | None = None
    condition: Condition | None = None


# --- Viewpoints and conditions ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SeenFrom:
    """A place to look from: "seen from the door"."""

    things: Things


Viewpoint = Robot | SeenFrom
Direction = Literal["left of", "right of", "in front of", "behind"]


@dataclass(frozen=True)
class Related:
    """A pairwise relation by its name in the registry of relations ("on", "near"), to a reference.

    `inverse`: the reference stands in the relation to the things ("desks with a mug on them": a mug is on the desk).
    """

    relation: str
    reference: Things
    inverse: bool = False


@dataclass(frozen=True)
class Having:
    """With an attribute, where it is said as a condition: "chairs that are not red", "is the table big"."""

    attribute: Attribute


@dataclass(frozen=True)
class Directed:
    """Left of, right of, in front of or behind a reference; `viewpoint` is `None` where the question states none."""

    direction: Direction
    reference: Things
    viewpoint: Viewpoint | None = None


@dataclass(frozen=True)
class Between:
    """Between two things, or between the things of one phrase ("between the chairs": `second` is `None`)."""

    first: Things
    second: Things | None = None


@dataclass(frozen=True)
class Distant:
    """At most, or more than, `metres` from a reference (the robot if it is `None`)."""

    metres: float
    farther: bool = False
    reference: Things | None = None


@dataclass(frozen=True)
class Happened:
    """Things to which something happened: "the chairs that moved since monday"."""

    event: Event
    when: Time | None = None


@dataclass(frozen=True)
class Not:
    """Not, without, except."""

    condition: Condition


@dataclass(frozen=True)
class Except:
    """Other things than these: "all chairs except chair-1"."""

    things: Things


@dataclass(frozen=True)
class And:
    """All of the conditions."""

    conditions: tuple[Condition, ...]


@dataclass(frozen=True)
class Or:
    """At least one of the conditions."""

    conditions: tuple[Condition, ...]


Condition = Related | Having | Directed | Between | Distant | Happened | Not | Except | And | Or

# --- Questions --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Find:
    """Which things, and where they are: "chair near the tv", "where is the cup", "what is on the desk".

    `place` is set for "where": the sentence then tells the place by the nearest landmarks.
    """

    things: Things
    place: bool = False


@dataclass(frozen=True)
class Count:
    """How many."""

    things: Things


@dataclass(frozen=True)
class Exists:
    """Is there one: "is there a piano", "are there two cups on the table", "did you meet anybody"."""

    things: Things


@dataclass(frozen=True)
class Holds:
    """Is it so: "is the cup on the table", "are all chairs near a desk"; `still`: "is the red chair still there"."""

    things: Things
    condition: Condition | None = None
    still: bool = False


@dataclass(frozen=True)
class MostOf:
    """Which of the things has most (or fewest) of others in a relation to it: "which desk has most mugs on it"."""

    things: Things
    counted: Things
    relation: str
    fewest: bool = False


@dataclass(frozen=True)
class CompareCounts:
    """Are there more of the first than of the second ("are there more chairs than tables"), `fewer`, or `equal`ly many
    ("are there as many chairs as tables").
    """

    first: Things
    second: Things
    fewer: bool = False
    equal: bool = False


@dataclass(frozen=True)
class CompareMeasure:
    """Which of two things exceeds by a measure ("which is bigger, chair-1 or chair-2", "is the desk taller than the
    table": `asked` is the first of them).
    """

    measure: Measure
    first: Things
    second: Things
    to: Things | None = None


@dataclass(frozen=True)
class HowFar:
    """The distance between two things, or between one and the robot."""

    first: Things
    second: Things | None = None


@dataclass(frozen=True)
class Describe:
    """An attribute of things: "what colour is the chair", "how big is the table", "what is chair-1"."""

    things: Things
    what: Literal["colour", "size", "height", "width", "name", "confidence", "all"]


@dataclass(frozen=True)
class When:
    """When, since when, until when, how long or how often something was so.

    - "at": when it happened (`event`). "since", "until": the ends of the present, or last, stay at its place.
    - "how long": the length of that stay. "how often": the number of such events, or of visits that saw it ("seen").
    """

    things: Things
    event: Event
    what: Literal["at", "since", "until", "how long", "how often"] = "at"


@dataclass(frozen=True)
class Changes:
    """What changed; `events` restricts it ("what is new": appeared; empty: anything), `things` to what it concerns.

    `count` is set for "how many things moved", `exists` for "has anything on the desk changed".
    """

    events: tuple[Event, ...] = ()
    things: Things | None = None
    count: bool = False
    exists: bool = False


@dataclass(frozen=True)
class MovedWhere:
    """Where things came from, or went to."""

    things: Things
    what: Literal["from", "to"]


Body = (
    Find
    | Count
    | Exists
    | Holds
    | MostOf
    | CompareCounts
    | CompareMeasure
    | HowFar
    | Describe
    | When
    | Changes
    | MovedWhere
)


@dataclass(frozen=True)
class Question:
    """A question; `time` is `None` where it has no words for one, `past` where its verb is in the past tense.

    `language` is the ISO 639-1 code of the grammar that read `text`. `others` are further readings of the same text, as
    good as this one; `mended` are misspelt words and those that were read instead. An answer tells both.
    """

    text: str
    body: Body
    time: Time | None = None
    past: bool = False
    language: str = "en"
    others: tuple[Body, ...] = ()
    mended: tuple[tuple[str, str], ...] = ()
