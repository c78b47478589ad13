"""A diff as an HTML page: plans before and after, changes with pictures of both sides, and a table of all instances."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

from supermap_cli.memory.images import Thumbnail, crop_jpegs, thumbnails_of
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.diff import CERTAIN_CHANGES, Diff, ObjectChange
from supermap_cli.query.views import EvidenceView, IntervalView, box_of
from supermap_cli.reports.diff_plan import before_after_panels
from supermap_cli.reports.files import write_file
from supermap_cli.reports.floor_plan import plan_svg
from supermap_cli.reports.page import badge, page, picture, table
from supermap_cli.reports.pictures import crop_around_box, data_uri

MAX_CARDS = 200
"""Further changes are listed in the table only."""

EXPLANATION = (
    "Only a place that was seen empty makes a disappearance or an appearance. What was merely not looked at, or never "
    "seen empty before, is “not observed again” or “first observed”. A change happened within the two times given; "
    "it is counted here because it was known to have happened by the later side."
)


def write_diff_page(diff: Diff, reader: MapReader, path: Path) -> None:
    """Write the page. Raises `SupermapError` if it cannot be written."""
    write_file(path, diff_page(diff, reader), "html", option="--html")


def diff_page(diff: Diff, reader: MapReader) -> str:
    """The page as HTML."""
    clock = clock_of(reader)
    listed = [change for change in diff.changes if change.kind in CERTAIN_CHANGES][:MAX_CARDS]
    pictures = ChangePictures.of(listed, reader, clock)
    title = f"{diff.before.name} → {diff.after.name}"
    return page(
        f"supermap diff {title}",
        [
            f"<h1>What changed: {escape(title)}</h1>",
            f'<p class="soft">{escape(_sides_text(diff, clock))} · {escape(reader.where)}</p>',
            _chips(diff.counts),
            *(f"<p>Note: {escape(note)}.</p>" for note in diff.notes),
            "<h2>The place from above</h2>",
            _panels(diff, reader),
            f"<h2>Changes ({len(listed)})</h2>" if listed else "<h2>Nothing changed that anybody saw</h2>",
            '<div class="cards">' + "".join(_change_card(change, pictures, clock) for change in listed) + "</div>",
            "<h2>Everything</h2>",
            _change_table(diff.changes, clock),
            f'<p class="soft">{EXPLANATION}</p>',
        ],
    )


@dataclass(frozen=True)
class ChangePictures:
    """The crops and keyframe images available for both sides of the changes."""

    crops: dict[int, bytes]
    images: dict[int, list[Thumbnail]]
    clock: Clock

    @classmethod
    def of(cls, changes: Iterable[ObjectChange], reader: MapReader, clock: Clock) -> ChangePictures:
        """Read the pictures of all changes at once."""
        listed = list(changes)
        ids = {
            crop_id for change in listed for crop_id in (change.crop_before, change.crop_after) if crop_id is not None
        }
        stamps = {
            stamp
            for change in listed
            for stamp in (*_keyframe_stamps(change, before=True), *_keyframe_stamps(change, before=False))
        }
        return cls(crop_jpegs(reader, ids), thumbnails_of(reader, stamps), clock)

    def side(self, change: ObjectChange, *, before: bool) -> str:
        """One side of a change: its crop, else its place in a keyframe that observed it or saw it empty."""
        own = change.interval_before if before else change.interval_after
        crop = change.crop_before if before else change.crop_after
        if own is not None and crop in self.crops:
            return picture(data_uri(self.crops[crop]), f"{'before' if before else 'after'}: observation {crop}")
        place = own or change.interval_after or change.interval_before
        shown = None if place is None else self._shown(place, _keyframe_stamps(change, before=before))
        if shown is not None:
            stamp_ns, cut = shown
            what = "seen" if own is not None else "its place, seen empty"
            return picture(data_uri(cut), f"{'before' if before else 'after'}: {what} {self.clock.brief(stamp_ns)}")
        nothing = "not there" if own is None else "no picture"
        return picture(None, "before" if before else "after", nothing)

    def _shown(self, place: IntervalView, stamps_ns: Iterable[int]) -> tuple[int, bytes] | None:
        """The first keyframe in which a camera has the place in view: its stamp, and the place cut out as a JPEG."""
        for stamp_ns in stamps_ns:
            for image in self.images.get(stamp_ns, ()):
                if (cut := crop_around_box(image, box_of(place.box))) is not None:
                    return stamp_ns, cut
        return None


def _keyframe_stamps(change: ObjectChange, *, before: bool) -> Sequence[int]:
    """The keyframes that may show one side, the most relevant first; if the object was absent on that side, the
    keyframe that saw its place empty.
    """
    if before and change.interval_before is None:
        return [] if change.not_before_ns is None else [change.not_before_ns]
    if not before and change.interval_after is None:
        return [] if change.not_after_ns is None else [change.not_after_ns]
    evidence = change.evidence_before if before else change.evidence_after
    stamps = list(evidence.keyframes_ns)
    return stamps[len(stamps) // 2 :] + stamps[: len(stamps) // 2]


def _sides_text(diff: Diff, clock: Clock) -> str:
    sides = []
    for side in (diff.before, diff.after):
        at = clock.text(side.at_ns)
        sides.append(at if side.traversal is None else f"{side.name} ({clock.text(side.since_ns)} to {at})")
    return " → ".join(sides)


def _chips(counts: dict[str, int]) -> str:
    chips = (f'<span class="chip">{badge(kind)} <b>{count}</b></span>' for kind, count in counts.items())
    return f'<div class="chips">{"".join(chips)}</div>'


def _panels(diff: Diff, reader: MapReader) -> str:
    panels = []
    for panel in before_after_panels(diff, reader):
        drawing = plan_svg(panel.extent, panel.outlines, panel.arrows, panel.trajectories, panel.title)
        panels.append(f"<figure><figcaption>{escape(panel.title)}</figcaption>{drawing}</figure>")
    return f'<div class="panels">{"".join(panels)}</div>'


def _change_card(change: ObjectChange, pictures: ChangePictures, clock: Clock) -> str:
    return (
        f'<article class="card"><h3>{badge(change.kind)} {escape(change.id)}</h3>'
        f"<p>{escape(change.reason)}</p>"
        f'<p class="soft">{escape(_facts_text(change, clock))}</p>'
        f'<div class="pair">{pictures.side(change, before=True)}{pictures.side(change, before=False)}</div></article>'
    )


def _facts_text(change: ObjectChange, clock: Clock) -> str:
    facts = [f"between {clock.brief(change.not_before_ns)} and {clock.brief(change.not_after_ns)}"]
    if change.perhaps_before:
        facts.append("perhaps before the earlier side")
    if change.kind == "moved" and change.distance_m is not None:
        facts.append(f"{change.distance_m:.2f} m")
    if change.label_before and change.label_after and change.label_before != change.label_after:
        facts.append(f"{change.label_before} → {change.label_after}")
    facts += [f"may be {candidate.id} ({candidate.probability:.0%})" for candidate in change.may_be]
    facts.append(f"confidence {change.confidence:.2f}")
    return " · ".join(facts)


def _change_table(changes: Sequence[ObjectChange], clock: Clock) -> str:
    columns = ("what", "id", "label", "why", "between", "from (m)", "to (m)", "distance (m)#", "confidence#")
    return table(columns, ((_row(change, clock), _evidence_row(change, clock)) for change in changes))


def _evidence_row(change: ObjectChange, clock: Clock) -> str:
    before = _evidence(change.evidence_before, change.crop_before, clock)
    after = _evidence(change.evidence_after, change.crop_after, clock)
    return f"<b>before</b> {before} · <b>after</b> {after}"


def _row(change: ObjectChange, clock: Clock) -> tuple[str, ...]:
    labels = [label for label in dict.fromkeys((change.label_before, change.label_after)) if label is not None]
    moved = change.kind == "moved" and change.distance_m is not None
    may_be = "".join(f"; may be {candidate.id} ({candidate.probability:.0%})" for candidate in change.may_be)
    bounds = () if change.not_after_ns is None else (change.not_before_ns, change.not_after_ns)
    times = [*(clock.brief(bound_ns) for bound_ns in bounds), *(["(perhaps before)"] if change.perhaps_before else [])]
    return (
        badge(change.kind),
        f'<span class="whole">{escape(change.id)}</span>',
        escape(" → ".join(labels) or change.label),
        f'<span class="why">{escape(change.reason + may_be)}</span>',
        "<br>".join(f'<span class="whole">{escape(time_text)}</span>' for time_text in times),
        _position_cell(change.interval_before),
        _position_cell(change.interval_after),
        f"{change.distance_m:.2f}" if moved else "",
        f"{change.confidence:.2f}",
    )


def _position_cell(interval: IntervalView | None) -> str:
    listed = "" if interval is None else ", ".join(f"{value:.2f}" for value in interval.position)
    return f'<span class="whole">{listed}</span>'


def _evidence(evidence: EvidenceView, crop: int | None, clock: Clock) -> str:
    """Ids of observations, first and last keyframe, and the visit counts of the place."""
    counts_text = f"in view {evidence.in_view}, supported {evidence.supported}, seen empty {evidence.contradicted}"
    if not evidence.observations:
        return escape(f"no observation; {counts_text}")
    more = ", …" if evidence.observation_count > len(evidence.observations) else ""
    best = "" if crop is None else f", best picture {crop}"
    first, last = clock.brief(evidence.keyframes_ns[0]), clock.brief(evidence.keyframes_ns[-1])
    ids = ", ".join(map(str, evidence.observations))
    return escape(f"{evidence.observation_count} observations ({ids}{more}{best}), {first} to {last}; {counts_text}")
