"""A mapping session: sensors push in, map deltas come out. It reads like Algorithm 1 of the paper (appendix).

P(I_t, M_t, P_t | M_t-1, Q_t) = pose estimation x instance association x map update (paper, eq. 2). The pose comes from
an odometry (`stages.localization`), the association and the update are the steps of `MappingSession._map`, which are
carried out by the mapping engine (`mapping.engine`). Perception is late by nature: keyframes wait for their detections
for a fixed lag (`stages.fixed_lag`), so the map does not depend on how late they come.
A session has no thread and no database: a driver (`drivers`) pushes, and stores what comes out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from supermap_cli.config import BuildConfig
from supermap_cli.errors import SessionError
from supermap_cli.geometry.trajectory import Trajectory
from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.mapping.keyframe_view import KeyframeView
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.missed_detections import MissedObject
from supermap_cli.mapping.objects import MapObject
from supermap_cli.observing import Observers
from supermap_cli.relations.registry import RELATIONS
from supermap_cli.stages.awaited_detections import AwaitedDetections
from supermap_cli.stages.camera_trackers import CameraTrackers
from supermap_cli.stages.checked_answers import checked_tracks
from supermap_cli.stages.keyframe_record import keyframe_record
from supermap_cli.stages.localization import Localizer, LocatedFrame
from supermap_cli.stages.map_registration import MapRegistration, Placement
from supermap_cli.stages.perception import generate_masks
from supermap_cli.stages.scene_nodes import SceneNodes
from supermap_cli.stages.session_odometry import SessionOdometry
from supermap_cli.stages.session_state import SessionBackends, SessionState, begin
from supermap_cli.stages.session_walls import SessionWalls
from supermap_cli.timing import StageClock
from supermap_cli.types.detections import Detections, TrackPrior, Tracks, plainly_labelled
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import MapDelta, SpatialEdge
from supermap_cli.types.sensing import CameraFrame, ImuSample, StampedPose, Sweep
from supermap_cli.types.session import LocalizationState


class MappingSession:
    """One traversal, mapped while it goes on. All that is pushed has its sensor's time, and goes forward in it.

    `add_detections` may come late and out of order. `step` after any push gives the changes of each keyframe that has
    been mapped by now; the same pushes give the same map, whenever it is stepped. What is held is bounded by the time
    between two steps, whatever the length.
    """

    def __init__(
        self,
        config: BuildConfig,
        backends: SessionBackends,
        initial: SessionState | None = None,
        *,
        align: str = "auto",
        observers: Observers | None = None,
        clock: StageClock | None = None,
        clock_shift_ns: int = 0,
    ) -> None:
        """`initial` is what is known before the first frame (an empty map, if it is not given); `align` places the
        traversal where `initial` has no placement; times in the map are the sensors' plus `clock_shift_ns`.
        """
        initial = begin(config) if initial is None else initial
        self.config = config
        self.backends = backends
        self.engine = initial.engine
        self.engine.use_detector(backends.detector)
        graph = initial.parameters.graph
        self._nodes = SceneNodes()
        self.walls = initial.walls
        self.graph = SceneGraph(
            RELATIONS.with_further(backends.predicates).stored,
            {},
            graph.scene_graph,
            graph.predicates,
            SessionWalls(self.walls, lambda: self._nodes.by_number),
            initial.across_walls,
        )
        self.graph.resume(initial.spatial_edges, self._nodes.update(self.engine.objects))
        self._structure = initial.parameters.mapping.structure
        self.trackers = CameraTrackers(backends.make_tracker, initial.trackers)
        self.observers = observers or Observers()
        self.clock = clock or StageClock()
        self.clock_shift_ns = clock_shift_ns
        self.statistics = initial.statistics
        self.newest: LocatedFrame | None = None
        self.localizer = Localizer(
            initial.placement,
            MapRegistration(Trajectory(), align, initial.earlier, initial.parameters.mapping),
            initial.drift,
            self.clock,
            placing_s=config.keyframes.placing_s,
            clock_shift_ns=clock_shift_ns,
            without_pose=initial.statistics.without_pose,
        )
        self._traversal_number = initial.traversal_number
        self._odometry = SessionOdometry(backends.odometry, self.localizer)
        self._awaited = AwaitedDetections(config.perception.wait_s)
        self._newest_ns = initial.newest_ns
        self._closed = False

    @property
    def state(self) -> LocalizationState:
        """Placing, mapping or lost."""
        return self.localizer.state

    @property
    def placement(self) -> Placement | None:
        """Where the traversal stands in the map; `None` while it is not known."""
        return self.localizer.placement

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful in what was pushed, and what was left out, one line each."""
        left_out = {
            "images had no pose and were left out": self.statistics.without_pose,
            "images of the time before the traversal was placed were too many to keep": self.localizer.thinned,
        }
        counts = [f"{count} {what}" for what, count in left_out.items() if count]
        placing = self.placement.warnings if self.placement else ()
        return (*self._odometry.warnings, *placing, *counts, *self._awaited.warnings)

    # -- what sensors say

    def add_imu(self, sample: ImuSample) -> None:
        """An IMU sample, in its own frame."""
        self._push(self._odometry.add_imu, sample)

    def add_pose(self, pose: StampedPose) -> None:
        """A pose `T_odom_base` of the robot's own odometry."""
        self._push(self._odometry.add_pose, pose)

    def add_sweep(self, sweep: Sweep) -> None:
        """A LiDAR sweep, not yet deskewed."""
        self._push(self._odometry.add_sweep, sweep)

    def add_frame(self, frame: CameraFrame, *, awaits_detections: bool = True) -> None:
        """A camera frame of any of the cameras; one without depth takes it from the sweeps about it.

        One that awaits no detections contributes its depth only. Raises `SessionError` for one older than the last.
        """
        self._awaited.announce(frame.stamp_ns + self.clock_shift_ns, frame.camera_id, awaits=awaits_detections)
        self._push(self._odometry.add_frame, frame, awaits_detections)

    def add_detections(self, detections: Detections) -> None:
        """What was found in the image of their stamp and camera; too late, or of no such image, they are counted."""
        self._check_open()
        self._awaited.add(detections.stamp_ns + self.clock_shift_ns, plainly_labelled(detections))

    def _push(self, add: Callable[..., None], *message: object) -> None:
        self._check_open()
        add(*message)
        for located in self.localizer.located():
            self.add_located(located)

    def _check_open(self) -> None:
        if self._closed:
            raise SessionError("the traversal has ended", cure="open another session")

    # -- what comes out

    def step(self) -> list[MapDelta]:
        """Map the keyframes that wait for nothing any more: what each of them changed."""
        return list(self.mapped())

    def drain(self) -> list[MapDelta]:
        """Map all frames that have a place, with the detections that have come: what each keyframe changed. Frames wait
        on while their pose is to come, or the traversal to be placed; only `close` places it by what there is.
        """
        return list(self.mapped(closing=True))

    def close(self) -> list[MapDelta]:
        """End the traversal. Returns what the last keyframes changed, and at last what its end did.

        Raises `OdometryError` when there was no motion, `AlignmentError` when the traversal fits nowhere in the map.
        """
        return list(self.closing())

    def closing(self) -> Iterator[MapDelta]:
        """The same, one by one; nothing where the session is closed already."""
        if self._closed:
            return
        self._closed = True
        self._odometry.finish()
        for located in self.localizer.located(closing=True):
            self.add_located(located)
        self._awaited.finish()
        yield from self.mapped(closing=True)
        self.statistics.without_pose = self.localizer.without_pose
        if self._newest_ns is not None:
            self.engine.end_traversal()
            with self.clock.stage("graph"):
                edges = self.update_scene_graph(self._newest_ns)
                edges = (*edges, *self.graph.end_across_walls(self._nodes.by_number))
            delta = replace(self._take_changes(), spatial_edges=tuple(edges))
            self.observers.mapped(None, delta)
            yield delta

    def add_located(self, located: LocatedFrame) -> None:
        """A frame that the localizer has placed, which a driver may have asked ahead of time."""
        keyframe = located.keyframe
        if self.engine.floor_z is None and self.placement is not None:
            self.engine.floor_z = self.placement.floor_z
        self.observers.frame(located.frame, keyframe.T_map_base, located.sweep)
        self._awaited.expect(located)

    def advance(self, stamp_ns: int) -> None:
        """Sensor time has gone on to here."""
        self._awaited.advance(stamp_ns + self.clock_shift_ns)

    def mapped(self, *, closing: bool = False) -> Iterator[MapDelta]:
        """Map those of the located keyframes that wait for nothing any more, one by one; all of them when closing."""
        return (self._map(*settled) for settled in self._awaited.settled(closing=closing))

    # -- Algorithm 1

    def _map(self, located: LocatedFrame, detections: Detections | None) -> MapDelta:
        """Algorithm 1 for one keyframe; without detections only its depth speaks.

        Ours departs in the order of steps: GenerateMasks comes before Associate, and labels are fused inside ObjMerge.
        Who was missed is known only after the association, so ObjMerge comes before ObjNegate.
        """
        keyframe = located.keyframe
        added: Sequence[LiftedDetection] = ()
        with self.clock.stage("visibility"):
            neighbors = self.get_neighbor_objects(keyframe)
            view = self.compare_depth(keyframe, neighbors)
        if detections is not None:
            detections = self.generate_masks(located.frame, detections)
            with self.clock.stage("track"):
                priors = self.update_from_map(view)
                tracks = self.associate(keyframe, detections, priors)
        with self.clock.stage("map"):
            if detections is not None:
                view, added = self.unproject(view, detections, tracks)
            matched = self.obj_merge(view, added)
            missed = self.check_semantic_consistency(view, matched, detections)
            self.obj_negate(view, missed)
            self.map_merge(keyframe, matched)
        with self.clock.stage("graph"):
            edges = self.update_scene_graph(keyframe.stamp_ns)
        with self.clock.stage("record"):
            return self.record(located, detections, edges)

    def get_neighbor_objects(self, keyframe: Keyframe) -> Sequence[MapObject]:
        """GetNeighborObjects: the map's objects within the sensor's reach."""
        return self.engine.get_neighbor_objects(keyframe)

    def compare_depth(self, keyframe: Keyframe, neighbors: Sequence[MapObject]) -> KeyframeView:
        """CompareDepth: which of their points are observable, unobservable, or have disappeared (eq. 7 and 9)."""
        return self.engine.compare_depth(keyframe, neighbors)

    def generate_masks(self, frame: CameraFrame, detections: Detections) -> Detections:
        """GenerateMasks, for the boxes that came without."""
        return generate_masks(self.backends.segmenter, frame, detections)

    def update_from_map(self, view: KeyframeView) -> tuple[TrackPrior, ...]:
        """UpdateFromMap: where the map expects the tracked objects in this image (eq. 5)."""
        return self.engine.update_from_map(view)

    def associate(self, keyframe: Keyframe, detections: Detections, priors: Sequence[TrackPrior]) -> Tracks:
        """Associate: the camera's own tracker links detections over time."""
        size = (keyframe.camera.width, keyframe.camera.height)
        tracker = self.trackers.of(keyframe.camera_id)
        tracks = checked_tracks(tracker.update(detections, priors, size), tracker, len(detections))
        self.observers.perceived(keyframe, detections, detections.masks, tracks)
        return tracks

    def unproject(
        self, view: KeyframeView, detections: Detections, tracks: Tracks
    ) -> tuple[KeyframeView, list[LiftedDetection]]:
        """Unproject: the detections' masks as points in the map; the view may have been turned for that."""
        view, lifted = self.engine.unproject(view, detections, tracks.track_ids)
        self.statistics.lifted += len(lifted)
        return view, lifted

    def obj_merge(self, view: KeyframeView, added: Sequence[LiftedDetection]) -> set[int]:
        """ObjMerge: detections are assigned to objects in 3D and fused with them (eq. 8 and 10), or start new ones."""
        return self.engine.obj_merge(view, added)

    def check_semantic_consistency(
        self, view: KeyframeView, matched: set[int], detections: Detections | None
    ) -> Sequence[MissedObject]:
        """Semantic consistency: the objects that were in view, and were not detected."""
        return self.engine.check_semantic_consistency(view, matched, detections)

    def obj_negate(self, view: KeyframeView, missed: Sequence[MissedObject]) -> None:
        """ObjNegate: empty space (eq. 8) and missed detections are evidence against objects."""
        self.engine.obj_negate(view, missed)

    def map_merge(self, keyframe: Keyframe, matched: set[int]) -> None:
        """MapMerge: objects are confirmed, found again elsewhere, merged and forgotten."""
        self.engine.map_merge(keyframe.stamp_ns, matched)

    def update_scene_graph(self, stamp_ns: int) -> Sequence[SpatialEdge]:
        """The spatial edges that began, ended or changed (section IV-C)."""
        nodes = self._nodes.update(self.engine.objects)
        return self.graph.update(nodes, self.engine.touched, stamp_ns, self.engine.left_ns)

    def record(self, located: LocatedFrame, detections: Detections | None, edges: Sequence[SpatialEdge]) -> MapDelta:
        """What the keyframe changed, and what the memory keeps of it."""
        keyframe = located.keyframe
        record = keyframe_record(keyframe, self.config.keyframes, detected=detections is not None)
        self.walls.add_record(record, self._structure)
        self.engine.free_space.add_keyframe(self._traversal_number, keyframe, self.config.keyframes.depth_step)
        delta = replace(self._take_changes(), keyframes=(record,), spatial_edges=tuple(edges))
        self.newest, self._newest_ns = located, keyframe.stamp_ns
        self.statistics.without_pose = located.mark.without_pose
        self.statistics.count_keyframe(detections)
        self.observers.mapped(record, delta)
        return delta

    def _take_changes(self) -> MapDelta:
        return self.statistics.count_changes(self.engine.take_changes())
