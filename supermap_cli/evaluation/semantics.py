"""Semantic segmentation scores of the map at its end, as in the open-vocabulary mapping literature.

Sources: ConceptGraphs (Gu et al., ICRA 2024; conceptgraph/utils/eval.py), HOV-SG (Werby et al., RSS 2024;
hovsg/utils/metric.py), ConceptFusion (Jatavallabhula et al., RSS 2023); the four figures are those of Long et al.,
"Fully convolutional networks for semantic segmentation", CVPR 2015, section 5.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.known_truth import known_truth
from supermap_cli.evaluation.shares import mean, share
from supermap_cli.evaluation.surface import SeenSurface, nearest_instances, seen_surface
from supermap_cli.geometry.arrays import FloatArray, IntArray, check_shape
from supermap_cli.geometry.voxels import pack_keys, voxel_keys
from supermap_cli.types.truth import GroundTruth

VOXEL_M = 0.05
"""Edge of the scored voxels in metres. Chosen."""
VOID = -1
"""Label of voxels that are not scored."""
BACKGROUND = 0
"""Label of the building."""
OTHER = 1
"""Stands for every label that the truth does not have; always wrong. The truth's labels are 2, 3, ..."""

BACKGROUND_NAME = "background"
MAX_CONFUSIONS = 10
"""Confused pairs of labels that are listed."""


@dataclass(frozen=True)
class ClassFigures:
    """One class: of `points` true points, iou = right / (true + predicted - right), accuracy = right / true."""

    label: int
    points: int
    iou: float
    accuracy: float


@dataclass(frozen=True)
class SemanticFigures:
    """Figures over the classes c that the truth has, with t_c true, p_c predicted and n_c right points.

    miou = mean of n_c / (t_c + p_c - n_c); fmiou = the same weighed by t_c / sum of t; accuracy = sum of n_c / sum of
    t; mean_accuracy = mean of n_c / t_c. All are `None` where there are no points.
    """

    miou: float | None
    fmiou: float | None
    accuracy: float | None
    mean_accuracy: float | None


def semantic_figures(
    true: IntArray, predicted: IntArray, *, without: Collection[int] = ()
) -> tuple[SemanticFigures, tuple[ClassFigures, ...]]:
    """The figures of predicted labels (n,) against true ones (n,), on any labelled point set, in all and by class.

    Points whose true label is `VOID` or among `without` are left out altogether, so that what is predicted there is no
    error (as in ConceptGraphs; HOV-SG would count it against the predicted class). A label that is predicted but that
    no point truly has makes no class of its own: its points are just missing elsewhere.
    """
    check_shape("true", true, (None,))
    check_shape("predicted", predicted, (len(true),))
    judged = ~np.isin(true, [VOID, *without])
    true, predicted = true[judged], predicted[judged]
    classes = []
    for label in np.unique(true).tolist():
        is_true, is_predicted = true == label, predicted == label
        right, points = int((is_true & is_predicted).sum()), int(is_true.sum())
        union = points + int(is_predicted.sum()) - right
        classes.append(ClassFigures(label, points, right / union, right / points))
    figures = SemanticFigures(
        miou=mean(class_figures.iou for class_figures in classes),
        fmiou=share(sum(class_figures.iou * class_figures.points for class_figures in classes), len(true)),
        accuracy=share(int((true == predicted).sum()), len(true)),
        mean_accuracy=mean(class_figures.accuracy for class_figures in classes),
    )
    return figures, tuple(classes)


@dataclass(frozen=True)
class LabelFigures:
    """The figures of one label, on `voxels` true voxels; with background, as far as that matters to the IoU."""

    label: str
    voxels: int
    iou: float
    accuracy: float


@dataclass(frozen=True)
class Confusion:
    """How many voxels of one label the map gives another."""

    true: str
    predicted: str
    voxels: int


@dataclass(frozen=True)
class SemanticScores:
    """Figures over the labels, on voxels of 5 cm that hold surface which images showed, as objects stand at the end.

    *Background* is the building, `background_labels` (walls, floor, ceiling, doors, windows), one class; what the map
    holds no instance of within 5 cm is predicted as background. A voxel's true label is that of most of its surface
    samples, its predicted label that of most of their nearest present instances. `with_background` judges all voxels,
    `without_background` those that are truly of a countable object (ConceptGraphs' and HOV-SG's ignored classes: wall,
    floor, ceiling, door, window); a background prediction on an object is an error in both. Ignored objects
    (`known_truth`) are void. `labels` are those of `with_background`, `confusions` its ten greatest errors.

    Of a map that lacks a part of the truth's traversals nothing is judged, and `note` says so: which surface was seen
    is known for all of them together only.
    """

    with_background: SemanticFigures
    without_background: SemanticFigures
    voxels: int
    background_labels: tuple[str, ...]
    labels: tuple[LabelFigures, ...]
    confusions: tuple[Confusion, ...]
    note: str | None = None


def score_semantics(estimate: EstimatedMap, truth: GroundTruth) -> SemanticScores:
    """Score the labels of all seen surfaces."""
    known = known_truth(estimate, truth)
    if known.gap is not None:
        nothing = SemanticFigures(None, None, None, None)
        return SemanticScores(nothing, nothing, 0, (), (), (), known.gap)
    surface = seen_surface(truth, known)
    present = [instance for instance in estimate.objects if instance.presence == "present"]
    names = _names(surface)
    nearest = nearest_instances(surface.points, present)
    label_of_instance = np.array([_number(instance.label, names) for instance in present] + [BACKGROUND], np.int64)
    true, predicted = on_voxels(surface.points, _true_labels(surface, names), label_of_instance[nearest])
    with_background, classes = semantic_figures(true, predicted)
    without_background, _ = semantic_figures(true, predicted, without={BACKGROUND})
    return SemanticScores(
        with_background=with_background,
        without_background=without_background,
        voxels=int((true != VOID).sum()),
        background_labels=surface.fixture_labels,
        labels=tuple(
            LabelFigures(names[class_figures.label], class_figures.points, class_figures.iou, class_figures.accuracy)
            for class_figures in classes
        ),
        confusions=_confusions(true, predicted, names),
    )


def on_voxels(points: FloatArray, true: IntArray, predicted: IntArray) -> tuple[IntArray, IntArray]:
    """The labels (v,), (v,) of the 5 cm voxels that points (n, 3) with two labels each (n,), (n,) fall into: the most
    frequent ones, the smaller of two that are equally frequent.
    """
    _, voxel = np.unique(pack_keys(voxel_keys(points, VOXEL_M)), return_inverse=True)
    return _most_frequent(voxel, true), _most_frequent(voxel, predicted)


def _most_frequent(group: IntArray, labels: IntArray) -> IntArray:
    """The most frequent label of each group 0, 1, ...: `group` (n,), `labels` (n,)."""
    lowest = int(labels.min(initial=0))
    n_labels = int(labels.max(initial=0)) - lowest + 1
    pairs, counts = np.unique(group * n_labels + (labels - lowest), return_counts=True)
    groups, labels = pairs // n_labels, pairs % n_labels + lowest
    order = np.lexsort([labels, -counts, groups])
    _, first = np.unique(groups[order], return_index=True)
    return labels[order][first]


def _names(surface: SeenSurface) -> list[str]:
    """The names of the classes by number: background, all that the truth does not have, and the truth's labels."""
    labels = {place.object.label.casefold() for place in surface.places if place.countable}
    return [BACKGROUND_NAME, "another label", *sorted(labels)]


def _number(label: str, names: list[str]) -> int:
    known = names[OTHER + 1 :]
    return known.index(label.casefold()) + OTHER + 1 if label.casefold() in known else OTHER


def _true_labels(surface: SeenSurface, names: list[str]) -> IntArray:
    label_of_place = [_number(place.object.label, names) if place.countable else VOID for place in surface.places]
    labels: IntArray = np.array([*label_of_place, BACKGROUND], np.int64)[surface.place]
    return labels


def _confusions(true: IntArray, predicted: IntArray, names: list[str]) -> tuple[Confusion, ...]:
    wrong = (true != VOID) & (true != predicted)
    counts = Counter(zip(true[wrong].tolist(), predicted[wrong].tolist(), strict=True))
    return tuple(Confusion(names[a], names[b], voxels) for (a, b), voxels in counts.most_common(MAX_CONFUSIONS))
