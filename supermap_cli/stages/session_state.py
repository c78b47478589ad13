"""What a mapping session begins with: an empty map, the map of earlier traversals, or a stopped build's checkpoint."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from supermap_cli.config import BuildConfig
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.mapping.drift import DriftCorrection
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.free_space import FreeSpaceMemory
from supermap_cli.mapping.objects import ObjectMap
from supermap_cli.mapping.structure import StructureParameters, stored_depth
from supermap_cli.mapping.walls import WallMap
from supermap_cli.parameters import MethodParameters
from supermap_cli.protocols import Odometry, Segmenter, Tracker
from supermap_cli.stages.map_registration import EarlierTraversals, Placement
from supermap_cli.stages.statistics import BuildStatistics
from supermap_cli.types.memory import KeyframeRecord, SpatialEdge
from supermap_cli.types.relations import SpatialRelation


@dataclass(frozen=True)
class SessionBackends:
    """The plugins at work inside a session. Each camera gets a tracker of its own.

    Without an `odometry` all poses are pushed; without a `segmenter` detections come with their masks. `detector`
    identifies what makes the detections: equal for detectors that err alike, empty if nobody knows.
    """

    make_tracker: Callable[[], Tracker]
    segmenter: Segmenter | None = None
    odometry: Odometry | None = None
    predicates: Sequence[SpatialRelation] = ()
    detector: str = ""


@dataclass
class PriorMap:
    """What earlier traversals left: objects, relations that still hold, keyframes with the number of their traversal
    (read anew at each call), and `T_map_odom` (4, 4) of each traversal, the latest first. `traversal_number` is that of
    the traversal which begins.
    """

    objects: ObjectMap = field(default_factory=ObjectMap)
    spatial_edges: tuple[SpatialEdge, ...] = ()
    keyframes: Callable[[], Iterable[tuple[int, KeyframeRecord]]] = tuple
    T_map_odom: Sequence[FloatArray] = ()
    traversal_number: int = 1

    def earlier(self, parameters: StructureParameters) -> EarlierTraversals:
        """What a further traversal is placed by: the depth images of earlier ones, in the map frame."""
        return EarlierTraversals(
            lambda: (stored_depth(record, parameters) for _, record in self.keyframes()), self.T_map_odom
        )


@dataclass
class SessionState:
    """All that a session knows before its first keyframe. `trackers` is each camera's tracker's own state,
    `newest_ns` the stamp of the keyframe mapped last by a build that goes on, `across_walls` what its scene graph has
    found (`SceneGraph.across_walls`).
    """

    engine: MappingEngine
    drift: DriftCorrection | None
    parameters: MethodParameters = field(default_factory=MethodParameters)
    spatial_edges: tuple[SpatialEdge, ...] = ()
    placement: Placement | None = None
    earlier: EarlierTraversals = field(default_factory=EarlierTraversals)
    traversal_number: int = 1
    statistics: BuildStatistics = field(default_factory=BuildStatistics)
    newest_ns: int | None = None
    trackers: dict[str, object] = field(default_factory=dict)
    walls: WallMap = field(default_factory=WallMap)
    across_walls: dict[tuple[int, int], tuple[float, ...]] = field(default_factory=dict)


def begin(config: BuildConfig, prior: PriorMap | None = None, placement: Placement | None = None) -> SessionState:
    """The state of a new traversal: objects, relations and what was seen empty before are known from earlier ones.

    Raises `ConfigError` for a parameter that the method does not have.
    """
    prior = prior or PriorMap()
    parameters = MethodParameters.from_overrides(config.parameters)
    mapping = parameters.mapping
    engine = MappingEngine(
        config.mapping,
        frozenset(config.ablate),
        prior.objects,
        FreeSpaceMemory(mapping.free_space),
        None if placement is None else placement.floor_z,
        parameters=mapping,
    )
    drift, walls = None, WallMap(mapping.walls)
    if config.mapping.correct_drift:
        drift = DriftCorrection(mapping.drift, mapping.icp, mapping.drift_evidence)
    for number, record in prior.keyframes():
        engine.free_space.add_record(number, record)
        walls.add_record(record, mapping.structure)
        if drift is not None:
            drift.add_view(stored_depth(record, mapping.structure))
    return SessionState(
        engine,
        drift,
        parameters,
        prior.spatial_edges,
        placement,
        prior.earlier(mapping.structure),
        prior.traversal_number,
        walls=walls,
    )
