"""The scores of a map as tables: each figure with its meaning, then the errors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.evaluation.answers import AnswerScores, WrongAnswer
    from supermap_cli.evaluation.calibration import Reliability, ReliabilityBin
    from supermap_cli.evaluation.identity import IdentityScores
    from supermap_cli.evaluation.instances import InstanceScores
    from supermap_cli.evaluation.objects import ObjectScores
    from supermap_cli.evaluation.report import ChangeSection, Report
    from supermap_cli.evaluation.semantics import SemanticScores
    from supermap_cli.evaluation.shares import PrecisionRecall

Cells = tuple[str, ...]

POOR_IOU = 0.5
"""Objects whose best instance has at most this IoU on points are listed. Chosen."""


@dataclass(frozen=True)
class Figure:
    """One line of a section: a figure and its meaning in plain words. `None`: undefined."""

    name: str
    value: float | None
    meaning: str
    unit: str = ""

    @property
    def cells(self) -> Cells:
        """As text; whole numbers are counts."""
        if self.value is None:
            return self.name, "-", self.meaning
        text = str(self.value) if isinstance(self.value, int) else f"{self.value:.3f}"
        return self.name, text + self.unit, self.meaning


@dataclass(frozen=True)
class ErrorTable:
    """A table of errors under its title."""

    title: str
    columns: Cells
    rows: tuple[Cells, ...]


def print_report(console: Console, report: Report) -> None:
    """All sections of a report."""
    off = ", ".join(f"{name} {rmse_m:.3f} m" for name, rmse_m in report.alignment_rmse_m.items())
    head = [f"{report.scenario}, seed {report.seed}", f"the robot's way off its true way: {off}", *_gaps(report)]
    console.print("; ".join(head) + "\n", markup=False)
    if report.map is not None:
        _print_section(console, "Objects at the map's end", _object_figures(report.map), _wrong_objects(report.map))
        print_reliability(console, report.map.calibration)
    if report.change is not None:
        _print_section(console, "Change", _change_figures(report.change), _wrong_changes(report.change))
    if report.identity is not None:
        _print_section(console, "Identity", _identity_figures(report.identity), _wrong_identities(report.identity))
    if report.instances is not None:
        _print_section(
            console, "Instances, on points", _instance_figures(report.instances), _poor_instances(report.instances)
        )
    if report.semantics is not None:
        _print_section(
            console, "Semantics, on points", _semantic_figures(report.semantics), _confusions(report.semantics)
        )
    if report.query is not None:
        _print_section(console, "Questions", _answer_figures(report.query), _wrong_answers(report.query))


def _gaps(report: Report) -> Iterator[str]:
    """Traversals of the truth that the map lacks, in words."""
    if names := report.not_mapped:
        yield f"judged without {', '.join(names)}: {'it is' if len(names) == 1 else 'they are'} not in the map"
    if names := report.partly_mapped:
        yield f"judged with a part of {', '.join(names)}: the rest is not in the map"


def _print_section(console: Console, title: str, figures: Iterable[Figure], error_tables: Iterable[ErrorTable]) -> None:
    print_table(console, title, ("figure", "value#", "what it says"), (figure.cells for figure in figures))
    for table in error_tables:
        if table.rows:
            print_table(console, table.title, table.columns, table.rows)


# -- objects


def _object_figures(scores: ObjectScores) -> Iterator[Figure]:
    yield from _precision_recall("", scores.labelled, "same label, boxes overlap (IoU > 0.1), centres within 0.3 m")
    yield from _precision_recall(" without label", scores.unlabelled, "the same, whatever the label")
    yield Figure("label accuracy", scores.label_accuracy, "of those in place, the share that is rightly called")
    yield Figure("centroid error", scores.centroid_error_m, "mean over the right ones", " m")
    yield Figure("box IoU", scores.iou, "mean over the right ones")
    yield Figure("objects", scores.countable_objects, "real ones that some image showed well")
    yield Figure("not judged", scores.ignored_objects, "real ones that no image showed well; finding them is no error")


def _precision_recall(suffix: str, scores: PrecisionRecall, right: str) -> Iterator[Figure]:
    yield Figure(f"F1{suffix}", scores.f1, f"precision and recall in one; right: {right}")
    yield Figure(f"precision{suffix}", scores.precision, f"{scores.found} right, {scores.false} false")
    yield Figure(f"recall{suffix}", scores.recall, f"{scores.found} found, {scores.missed} missed")


def _wrong_objects(scores: ObjectScores) -> Iterator[ErrorTable]:
    for title, wrong in (("missed", scores.missed), ("false", scores.false)):
        yield ErrorTable(title, ("id", "label", "why"), tuple((obj.id, obj.label, obj.reason) for obj in wrong))


def print_reliability(console: Console, scores: Reliability) -> None:
    """The confidences of instances against how many of these are right; bins without any are left out."""
    error = scores.expected_calibration_error
    if error is None:
        return
    title = f"How sure, and how right: expected calibration error {error:.3f}, 0 is perfect"
    named: list[tuple[str, ReliabilityBin | Reliability]] = [
        (f"{one.low:.1f} to {one.high:.1f}", one) for one in scores.bins if one.count
    ]
    rows = (
        (name, str(row.count), f"{row.mean_confidence:.3f}", f"{row.share_right:.3f}")
        for name, row in (*named, ("all", scores))
    )
    print_table(console, title, ("confidence", "instances#", "mean confidence#", "share right#"), rows)


# -- change


def _change_figures(section: ChangeSection) -> Iterator[Figure]:
    recall, reported = section.recall, section.reported
    for pooling, scores, how in (
        ("per object", recall.per_object, "mean over changed places"),
        ("per frame", recall.per_frame, "over all keyframes together"),
    ):
        yield Figure(
            f"detection recall, {pooling}",
            scores.detection_recall,
            f"keyframes with a changed thing in view for which the map has it; {how}",
        )
        yield Figure(
            f"change recall, {pooling}",
            scores.change_recall,
            "the same, and those with the place it has left in view, too",
        )
    claimed = None if section.claimed is None else len(section.claimed)
    yield Figure("claimed", claimed, "changes claimed within a first visit in which nothing changes")
    yield Figure("clean places", recall.clean_share, "emptied places where the map never has the thing after it left")
    if reported.between is None or reported.overall is None:
        return
    yield from _precision_recall(
        " of changes", reported.overall, f"kind, and place within 0.5 m; {' to '.join(reported.between)}"
    )
    for kind, scores_of_kind in (
        ("appeared", reported.appeared),
        ("disappeared", reported.disappeared),
        ("moved", reported.moved),
    ):
        if scores_of_kind is not None:
            counts = f"{scores_of_kind.found} found, {scores_of_kind.missed} missed, {scores_of_kind.false} false"
            yield Figure(f"F1 {kind}", scores_of_kind.f1, counts)
    if reported.lenient is not None:
        yield Figure("F1, lenient", reported.lenient.f1, "a move may be reported as a disappearance and an appearance")
    yield Figure("static reported", reported.static_reported, "things reported as changed that stand as before")


def _wrong_changes(section: ChangeSection) -> Iterator[ErrorTable]:
    places = tuple(
        (
            f"{place.object_id} ({', '.join(place.changes)})",
            f"{place.there_right} / {place.there_samples}",
            f"{place.left_right} / {place.left_samples}",
            f"{place.before_right} / {place.before_samples}",
        )
        for place in section.recall.places
    )
    yield ErrorTable(
        "changed places: keyframes the map is right about (those before it came count in no recall)",
        ("place", "while there#", "after it left#", "before it came#"),
        places,
    )
    reported = section.reported
    missed = tuple(
        (change.kind, change.object_id, "reported as two changes" if change.reported_as_two else "")
        for change in reported.missed
    )
    yield ErrorTable("changes missed", ("what", "id", "but"), missed)
    false = tuple(
        (
            change.kind,
            change.instance_id,
            f"{change.unchanged_object} stands as before" if change.unchanged_object else "",
        )
        for change in reported.false
    )
    yield ErrorTable("changes falsely reported", ("what", "id", "but"), false)
    claimed = tuple((change.kind, change.instance_id, change.label) for change in section.claimed or ())
    yield ErrorTable("changes claimed where nothing changes", ("what", "id", "label"), claimed)
    not_shown = tuple((change,) for change in reported.unobservable)
    yield ErrorTable("changes that the images do not show: not judged", ("id",), not_shown)


# -- identity


def _identity_figures(scores: IdentityScores) -> Iterator[Figure]:
    yield Figure("instances per object", scores.instances_per_object, "1 is perfect: nothing is in the map twice")
    yield Figure("switches", scores.switches, f"how often one of {scores.static_objects} still things changed its id")
    yield Figure(
        "relocated, found", scores.relocated_found, "share of moved things that the map noticed in the new place"
    )
    yield Figure("relocated, same id", scores.relocated_kept, "share of them that kept their id over the move")
    places = "1 place" if scores.vacated_places == 1 else f"{scores.vacated_places} places"
    yield Figure(
        "stale", len(scores.stale), f"things held to be there that have left; images showed {places} left empty"
    )
    yield Figure(
        "people, one track",
        scores.passages.followed,
        f"share of {scores.passages.judged} passages of people of which one instance has 0.9 of the observations",
    )
    yield Figure("IDF1", scores.tracking.idf1, scores.tracking.note or "share of sightings under the right identity")
    yield Figure("HOTA", scores.tracking.hota, "detection and association in one, over all overlaps")
    yield Figure("DetA", scores.tracking.det_a, "its detection part")
    yield Figure("AssA", scores.tracking.ass_a, "its association part")


def _wrong_identities(scores: IdentityScores) -> Iterator[ErrorTable]:
    several = tuple((obj.object_id, ", ".join(obj.instances)) for obj in scores.several)
    yield ErrorTable("in the map more than once", ("id", "as"), several)
    lost = tuple(
        (obj.object_id, "-" if obj.distance_m is None else f"{obj.distance_m:.2f}", ", ".join(obj.instances) or "-")
        for obj in scores.relocated
        if obj.kept is None
    )
    yield ErrorTable("moved and not known again", ("id", "moved (m)#", "in the new place"), lost)
    stale = tuple(
        (
            instance.instance_id,
            instance.object_id,
            "yes" if instance.seen_empty else "no, its place was not in view again",
        )
        for instance in scores.stale
    )
    broken = tuple(
        (passage.object_id, str(passage.observed), f"{passage.followed_share or 0:.2f}", ", ".join(passage.instances))
        for passage in scores.passages.broken
    )
    yield ErrorTable("people not followed as one", ("id", "observations#", "longest track#", "as"), broken)
    yield ErrorTable("stale", ("instance", "was", "could have been seen to be gone"), stale)


# -- instances and semantics, on points


def _instance_figures(scores: InstanceScores) -> Iterator[Figure]:
    right = "ScanNet's average precision: label and points right, mean over IoU .50 to .90 and over labels"
    yield Figure("AP", scores.ap, scores.note or right)
    yield Figure("AP50", scores.ap50, "the same at IoU .50")
    yield Figure("AP25", scores.ap25, "the same at IoU .25")
    together = "over all instances together, whatever the label (not a mean over labels)"
    yield Figure("AP without label", scores.regardless_ap, together)
    yield Figure("AP50 without label", scores.regardless_ap50, "the same at IoU .50")
    yield Figure("AP25 without label", scores.regardless_ap25, "the same at IoU .25")


def _poor_instances(scores: InstanceScores) -> Iterator[ErrorTable]:
    poor = tuple(
        (obj.object_id, obj.instance_id or "-", f"{obj.iou:.2f}", str(obj.points))
        for obj in scores.objects
        if obj.iou <= POOR_IOU
    )
    yield ErrorTable(f"shared points at most {POOR_IOU}", ("object", "best instance", "IoU#", "its points#"), poor)


def _semantic_figures(scores: SemanticScores) -> Iterator[Figure]:
    for figures, what in (
        (scores.without_background, "objects only"),
        (scores.with_background, f"with background: {', '.join(scores.background_labels)} as one class"),
    ):
        suffix = "" if figures is scores.without_background else ", background"
        right = f"IoU of labels on 5 cm voxels, mean over labels; {what}"
        yield Figure(f"mIoU{suffix}", figures.miou, scores.note or right)
        yield Figure(f"f-mIoU{suffix}", figures.fmiou, "the same, labels weighed by their size")
        yield Figure(f"accuracy{suffix}", figures.accuracy, "share of voxels with the right label")
        yield Figure(f"mean accuracy{suffix}", figures.mean_accuracy, "the same, mean over labels")


def _confusions(scores: SemanticScores) -> Iterator[ErrorTable]:
    rows = tuple((confusion.true, confusion.predicted, str(confusion.voxels)) for confusion in scores.confusions)
    yield ErrorTable("mostly confused", ("is", "in the map", "voxels#"), rows)


# -- questions


def _answer_figures(scores: AnswerScores) -> Iterator[Figure]:
    right = f"share of {scores.asked} questions with exactly the right things"
    yield Figure("answered right", scores.exact, scores.note or right)
    yield Figure("overlap", scores.jaccard, "shared / all things of answer and truth (Jaccard), mean over questions")


def _wrong_answers(scores: AnswerScores) -> Iterator[ErrorTable]:
    rows = tuple((answer.text, ", ".join(answer.expected) or "nothing", _answered(answer)) for answer in scores.wrong)
    yield ErrorTable("answered wrong", ("question", "right would be", "the map says"), rows)


def _answered(wrong: WrongAnswer) -> str:
    """The instances, each with what it really is."""
    if wrong.answered is None:
        return "(not understood)"
    pairs = zip(wrong.answered, wrong.answered_objects, strict=True)
    return ", ".join(f"{instance} (= {thing or 'nothing'})" for instance, thing in pairs) or "nothing"
