"""What things are like: colour, size, name, how sure the map is of them."""

from __future__ import annotations

from supermap_cli.language.questions import Describe
from supermap_cli.query.answering.attributes import size_of
from supermap_cli.query.answering.document import Measurement, Reply
from supermap_cli.query.answering.finding import missing_sentence
from supermap_cli.query.answering.listing import Lister
from supermap_cli.query.answering.phrases import with_article
from supermap_cli.query.answering.places import places
from supermap_cli.query.answering.things import ThingsFinder
from supermap_cli.query.candidates import InstanceCandidate, label_in_state

MAX_DESCRIBED = 12
"""Things that one sentence describes."""


def describe(finder: ThingsFinder, question: Describe, when: str) -> Reply:
    """An attribute of each of the things."""
    lister = Lister(finder)
    candidates = finder.all_candidates(question.things)
    if not candidates:
        nearest = lister.nearest(question.things)
        return Reply("describe", missing_sentence(finder, question.things, nearest, when), (), nearest)
    shown = candidates[:MAX_DESCRIBED]
    told = _descriptions(finder, shown, question.what)
    more = f"; and {len(candidates) - len(shown)} more" if len(candidates) > len(shown) else ""
    measures = tuple(measure for candidate in shown for measure in _measures(candidate, question.what))
    if question.what in {"colour", "all"} and finder.selector.kind not in {"now", "last"}:
        finder.asking.note("colours are those last seen")
    return Reply("describe", f"{'; '.join(told)}{more}.", lister.views(candidates), measures=measures)


def _descriptions(finder: ThingsFinder, candidates: list[InstanceCandidate], what: str) -> list[str]:
    match what:
        case "colour":
            colours = finder.attributes.colours(candidates)
            return [_colour_text(each.instance.id, colours[each.instance.number].words) for each in candidates]
        case "size" | "height" | "width":
            return [f"{each.instance.id} is {_size_text(each, what)}" for each in candidates]
        case "name":
            return [f"{each.instance.id} is {_name_text(each)}" for each in candidates]
        case "confidence":
            return [_confidence_text(each) for each in candidates]
        case _:
            colours, told = finder.attributes.colours(candidates), places(finder.asking, candidates, finder.selector)
            return [
                f"{each.instance.id} is {_name_text(each)}, {_size_text(each, 'size')}; colour: "
                f"{colours[each.instance.number].words}; {told.get(each.instance.number, 'no landmark is near')}; "
                f"last seen {finder.asking.clock.text(each.state.last_seen_ns)}; {each.instance.presence}"
                for each in candidates
            ]


def _colour_text(text_id: str, words: str) -> str:
    return f"{text_id}: {words}" if words.startswith(("no one", "too little")) else f"{text_id} is {words}"


def _size_text(candidate: InstanceCandidate, what: str) -> str:
    box = candidate.state.box
    match what:
        case "height":
            return f"{size_of(box, 'height'):.2f} m high"
        case "width":
            return f"{size_of(box, 'width'):.2f} m wide"
        case _:
            length, width = sorted((float(side) for side in box.size[:2]), reverse=True)
            return f"{length:.2f} m x {width:.2f} m, {float(box.size[2]):.2f} m high"


def _name_text(candidate: InstanceCandidate) -> str:
    """What it is called, with what else it may be."""
    label, belief = label_in_state(candidate.instance, candidate.state), candidate.instance.label_belief
    others = [f"{other} {share:.0%}" for other, share in belief.items() if other != label and share >= 0.1]
    share = f" ({belief[label]:.0%}{', else ' + ', '.join(others) if others else ''})" if label in belief else ""
    return f"{with_article(label)}{share}"


def _confidence_text(candidate: InstanceCandidate) -> str:
    share, seen = candidate.state.confidence, candidate.instance.observations
    return f"{candidate.instance.id} is real with {share:.0%}, from {seen} observations"


def _measures(candidate: InstanceCandidate, what: str) -> list[Measurement]:
    text_id, box = candidate.instance.id, candidate.state.box
    wanted = {"size": ("height", "width"), "all": ("height", "width"), "height": ("height",), "width": ("width",)}
    measures = [Measurement(text_id, each, round(size_of(box, each), 4), "m") for each in wanted.get(what, ())]
    if what == "confidence":
        measures.append(Measurement(text_id, what, round(candidate.state.confidence, 4), "1"))
    return measures
