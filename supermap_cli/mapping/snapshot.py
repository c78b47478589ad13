"""All that the engine and the drift correction know, as bytes: a build that was stopped goes on as if it had not been.

What a memory keeps of an object (`changes.instance_record`) is enough for another traversal, which counts anew what it
sees. Within one traversal every count matters, and so do objects that are tentative still. Left out is what the memory
holds anyway: the free space comes from its keyframes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from supermap_cli.config import Ablation, MappingConfig
from supermap_cli.geometry.boxes import Box3D
from supermap_cli.mapping.absence import AbsenceEvidence, EmptyRun
from supermap_cli.mapping.belief import Existence, LabelBelief, OutcomeRun, ViewpointCell, ViewpointHistory
from supermap_cli.mapping.drift import DriftCorrection, DriftMark, KnownSurfaces
from supermap_cli.mapping.drift_evidence import DriftBelief
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.floor_by_feet import FloorByFeet, FootRays
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.map_update import IdentityLinks
from supermap_cli.mapping.motion import Course, MotionState
from supermap_cli.mapping.object_shape import ObjectShape
from supermap_cli.mapping.objects import (
    DisplacementEvidence,
    MapObject,
    MissEvidence,
    ObjectMap,
    ObjectStatus,
    OpenState,
    VisitCount,
)
from supermap_cli.mapping.pair_evidence import PairEvidence
from supermap_cli.mapping.parameters import MappingParameters
from supermap_cli.mapping.recall import FoundBy, RecallModel, ScoreModel
from supermap_cli.mapping.relief import ReliefLooks
from supermap_cli.mapping.splitting import Halves, SplitEvidence
from supermap_cli.mapping.structure import Structure
from supermap_cli.mapping.voxel_map import VoxelMap
from supermap_cli.types.detections import Hypothesis
from supermap_cli.types.memory import Observation
from supermap_cli.types.packing import pack, unpack

CLASSES: Mapping[type, tuple[str, ...]] = {
    MapObject: ("_changed", "parameters"),
    VoxelMap: ("_keys", "_centers", "_sphere"),
    LabelBelief: ("_cached", "parameters", "size_parameters"),
    SplitEvidence: ("parameters", "belief_parameters"),
    **dict.fromkeys((ObjectShape, ViewpointHistory, Course, MotionState), ("parameters",)),
    **dict.fromkeys((PairEvidence, RecallModel, ScoreModel, FloorByFeet), ("parameters",)),
    **dict.fromkeys((FoundBy, ReliefLooks, ObjectStatus, OpenState, Existence, ViewpointCell, OutcomeRun), ()),
    **dict.fromkeys(
        (VisitCount, AbsenceEvidence, EmptyRun, DisplacementEvidence, MissEvidence, Halves, IdentityLinks, FootRays), ()
    ),
    **dict.fromkeys((Observation, Hypothesis, Box3D, DriftMark, DriftBelief), ()),
}
"""What a snapshot consists of -> what is left out: what is worked out anew when it is asked for, and the parameters."""


def engine_snapshot(engine: MappingEngine) -> bytes:
    """The engine between two batches: nothing is waiting to be written."""
    objects = engine.objects
    return pack(
        {
            "objects": list(objects),
            "next_number": objects.next_number,
            "floor_z": engine.floor_z,
            "recall": engine.recall,
            "scores": engine.scores,
            "pairs": engine.pairs,
            "splits": engine.splits,
            "links": engine.links,
            "feet": engine.feet,
        },
        CLASSES,
    )


def restore_engine(
    snapshot: bytes,
    config: MappingConfig | None = None,
    ablate: frozenset[Ablation] = frozenset(),
    free_space: FreeSpaceMemory | None = None,
    parameters: MappingParameters | None = None,
) -> MappingEngine:
    """A new engine that is where another one was; only the free space, which the memory holds, is given to it.

    Raises `packing.PackingError` for bytes that are no snapshot.
    """
    kept = unpack(snapshot, CLASSES)
    parameters = parameters or MappingParameters()
    objects = ObjectMap(kept["next_number"], parameters=parameters.object_sets())
    for obj in kept["objects"]:
        objects.add(obj)
    return MappingEngine(
        config or MappingConfig(),
        ablate,
        objects,
        free_space or FreeSpaceMemory(),
        kept["floor_z"],
        kept["recall"],
        kept["scores"],
        kept["pairs"],
        kept["splits"],
        kept["links"],
        kept["feet"],
        parameters,
    )


def drift_snapshot(drift: DriftCorrection, mark: DriftMark) -> bytes:
    """The drift correction as it was at a mark; it may have gone on since."""
    known = drift.known.structure
    kept: dict[str, Any] = {
        "points": known.points[: mark.known],
        "normals": known.normals[: mark.known],
        "sources": drift.known.sources[: mark.known],
        "past": list(drift.evidence.past.first(mark.remembered)),
        "mark": mark,
    }
    return pack(kept, CLASSES)


def restore_drift(snapshot: bytes, parameters: MappingParameters | None = None) -> DriftCorrection:
    """The drift correction as it was. Raises `packing.PackingError` for bytes that are no snapshot."""
    parameters = parameters or MappingParameters()
    kept = unpack(snapshot, CLASSES)
    known = KnownSurfaces()
    known.add(Structure(kept["points"], kept["normals"]), kept["sources"])
    drift = DriftCorrection(parameters.drift, parameters.icp, parameters.drift_evidence)
    drift.resume(kept["mark"], known, tuple(kept["past"]))
    return drift
