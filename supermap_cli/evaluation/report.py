"""All scores of one map: the document of `supermap eval`."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Literal, get_args

from supermap_cli.evaluation.answers import AnswerScores, score_answers
from supermap_cli.evaluation.change_recall import ChangeRecallScores, score_change_recall
from supermap_cli.evaluation.changes import ChangeScores, score_changes
from supermap_cli.evaluation.claimed_changes import ClaimedChange, claimed_changes
from supermap_cli.evaluation.estimate import EstimatedMap
from supermap_cli.evaluation.identity import IdentityScores, score_identity
from supermap_cli.evaluation.instances import InstanceScores, score_instances
from supermap_cli.evaluation.known_truth import known_truth
from supermap_cli.evaluation.objects import ObjectScores, score_objects
from supermap_cli.evaluation.semantics import SemanticScores, score_semantics
from supermap_cli.types.truth import GroundTruth

Section = Literal["map", "change", "identity", "instances", "semantics", "query"]
SECTIONS: tuple[Section, ...] = get_args(Section)
OPTIONAL = {"optional": True}
"""Field metadata: left out of the JSON document where the field is `None`."""


@dataclass(frozen=True)
class ChangeSection:
    """The paper's recalls of changed objects, precision and recall of reported changes (as in Khronos), and what
    the map claims to have changed within a first traversal in which nothing does.
    """

    recall: ChangeRecallScores
    reported: ChangeScores
    claimed: tuple[ClaimedChange, ...] | None


@dataclass(frozen=True)
class Report:
    """The requested scores. `alignment_rmse_m`: by traversal, the error of the robot's trajectory in the map against
    the true one after the alignment. Of the truth's traversals, `not_mapped` are not in the map and `partly_mapped`
    only in part.
    """

    scenario: str
    seed: int
    alignment_rmse_m: dict[str, float]
    not_mapped: tuple[str, ...] = ()
    partly_mapped: tuple[str, ...] = ()
    map: ObjectScores | None = field(default=None, metadata=OPTIONAL)
    change: ChangeSection | None = field(default=None, metadata=OPTIONAL)
    identity: IdentityScores | None = field(default=None, metadata=OPTIONAL)
    instances: InstanceScores | None = field(default=None, metadata=OPTIONAL)
    semantics: SemanticScores | None = field(default=None, metadata=OPTIONAL)
    query: AnswerScores | None = field(default=None, metadata=OPTIONAL)


def score(estimate: EstimatedMap, truth: GroundTruth, sections: Collection[Section] = SECTIONS) -> Report:
    """Score a map in the given sections."""
    known = known_truth(estimate, truth)
    return Report(
        scenario=truth.scenario,
        seed=truth.seed,
        alignment_rmse_m=estimate.alignment_rmse_m,
        not_mapped=known.not_mapped,
        partly_mapped=known.partly_mapped,
        map=score_objects(estimate, truth) if "map" in sections else None,
        change=_change(estimate, truth) if "change" in sections else None,
        identity=score_identity(estimate, truth) if "identity" in sections else None,
        instances=score_instances(estimate, truth) if "instances" in sections else None,
        semantics=score_semantics(estimate, truth) if "semantics" in sections else None,
        query=score_answers(estimate, truth) if "query" in sections else None,
    )


def _change(estimate: EstimatedMap, truth: GroundTruth) -> ChangeSection:
    return ChangeSection(
        score_change_recall(estimate, truth), score_changes(estimate, truth), claimed_changes(estimate, truth)
    )
