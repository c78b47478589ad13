"""The way of one frame through every stage."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from typing import cast

import cv2
import numpy as np

from supermap_cli.building.backends import Backends
from supermap_cli.building.checkpoints import AheadMark, AheadMarks, BuildState, make_checkpoint, read_checkpoint
from supermap_cli.building.keyframe_choice import KeyframeChoice, choose_keyframes
from supermap_cli.building.late_results import LateResults
from supermap_cli.building.lookahead import LookAhead
from supermap_cli.building.placing import Placement
from supermap_cli.building.tally import Tally
from supermap_cli.config import BuildConfig
from supermap_cli.errors import MemoryStoreError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import camera_to_json
from supermap_cli.graph.predicates import PREDICATES
from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.mapping.drift import DriftCorrection
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.mapping.lifting import LiftedDetection
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.mapping.snapshot import restore_drift, restore_engine
from supermap_cli.mapping.structure import coarse_depth, stored_depth
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import Checkpoint, StoredTraversal
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Recording, Resumable
from supermap_cli.recordings.lidar_depth import SweepDepth
from supermap_cli.timing import StageClock
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta, SpatialEdge
from supermap_cli.types.packing import PackingError
from supermap_cli.types.relations import GraphNode
from supermap_cli.types.sensing import CameraFrame

Progress = Callable[[int, int], None]
"""Called with a keyframe's stamp in the recording and the number of keyframes mapped so far."""


class FramePipeline:
    """All stages, and what they know: `batches` reads like the method.

    First `restore` or `resume`; then `batches`, and a `checkpoint` after any of them.
    """

    def __init__(
        self,
        recording: Recording,
        backends: Backends,
        plugins: Plugins,
        config: BuildConfig,
        clock: StageClock,
        *,
        look_ahead: bool = True,
    ) -> None:
        """Without `look_ahead` one stage runs at a time."""
        self.recording = recording
        self.backends = backends
        self.plugins = plugins
        self.config = config
        self.clock = clock
        self.look_ahead = look_ahead
        self.tally = Tally()
        self.late = LateResults(config.perception)
        self.ahead = AheadMarks()
        self.shift_ns = 0
        self.newest_ns = 0
        self.resumed_ns: int | None = None
        self.nodes: dict[int, GraphNode] = {}

    def batches(self, placement: Placement, progress: Progress | None = None) -> Generator[MapDelta]:
        """Map every keyframe, and hand over what each batch of whole ones has changed.

        Keyframes have the map's time, the recording's own plus `shift_ns`; all before them has the recording's.
        """
        with self._run_ahead(self._perceived(placement)) as perceived:
            yield from self._mapped(self.late.settled(perceived), progress)

    def _run_ahead(
        self, perceived: Iterator[tuple[Keyframe, Detections | None]]
    ) -> AbstractContextManager[Iterable[tuple[Keyframe, Detections | None]]]:
        return LookAhead(perceived) if self.look_ahead else nullcontext(perceived)

    # -- before the first frame

    def go_on_in_time(self, shift_ns: int) -> None:
        """From here on times in the map are the recording's own plus a shift."""
        self.shift_ns = self.late.clock_shift_ns = shift_ns

    def restore(self, store: MapStore, placement: Placement) -> None:
        """Go on from what earlier traversals left: objects, open relations, and which space was seen empty when."""
        with self.clock.stage("restore"):
            objects = restore_objects(store.load_instances(), store.next_object_number())
            self.engine = MappingEngine(
                self.config.mapping, frozenset(self.config.ablate), objects, floor_z=placement.floor_z
            )
            self.drift = DriftCorrection() if self.config.mapping.correct_drift else None
            for traversal in store.traversals():
                for record in store.keyframe_depths([traversal.id]):
                    self.engine.free_space.add_record(traversal.number, record)
                    if self.drift is not None:
                        self.drift.add_view(stored_depth(record))
            self.traversal_number = max((each.number for each in store.traversals()), default=1)
            self._relate_from(store.load_spatial_edges(open_only=True))

    def resume(self, store: MapStore, stopped: StoredTraversal, checkpoint: Checkpoint) -> BuildState:
        """Bring every stage to where it was at a stopped build's checkpoint.

        Raises `MemoryStoreError` where the checkpoint is damaged.
        """
        with self.clock.stage("restore"), _damage_told(store.where):
            state = read_checkpoint(checkpoint)
            self.engine = restore_engine(checkpoint.parts["engine"], self.config.mapping, frozenset(self.config.ablate))
            self.drift = restore_drift(checkpoint.parts["drift"]) if "drift" in checkpoint.parts else None
            for traversal in store.traversals():
                until_ns = checkpoint.stamp_ns if traversal.id == stopped.id else None
                for record in store.keyframe_depths([traversal.id], until_ns=until_ns):
                    self.engine.free_space.add_record(traversal.number, record)
            cast("Resumable", self.backends.tracker).resume(state.tracker)
            self.tally = state.tally
            self.go_on_in_time(stopped.clock_shift_ns)
            self.resumed_ns = self.newest_ns = checkpoint.stamp_ns
            self.ahead.add(self._ahead_mark(checkpoint.stamp_ns))
            self.traversal_number = stopped.number
            self._relate_from(state.held_edges)
        return state

    def checkpoint(self, placement: Placement, spent_s: dict[str, float]) -> Checkpoint:
        """The state of every stage after the batch that was handed over last."""
        with self.clock.stage("checkpoint"):
            tracker = cast("Resumable", self.backends.tracker).state()
            state = BuildState(placement, self.tally, spent_s, list(self.graph.held.values()), tracker)
            return make_checkpoint(self.ahead.take(self.newest_ns), state, self.engine, self.drift)

    def _relate_from(self, held: Iterable[SpatialEdge]) -> None:
        """The scene graph goes on from open relations."""
        further = [each for group in self.plugins.hook.spatial_predicates() for each in group]
        self.graph = SceneGraph((*PREDICATES, *further))
        self.graph.resume(held)
        self.engine.objects.bounds()
        self._nodes()

    # -- the way of one frame

    def _choose_keyframes(self) -> KeyframeChoice:
        """Those that are due; a build that goes on begins after its checkpoint."""
        stamps_ns, able_ns = self.recording.frame_stamps_ns(), self.backends.detector.image_stamps_ns()
        self.tally.frames = len(stamps_ns)
        config = self.config
        chosen = choose_keyframes(stamps_ns, able_ns, config.keyframes.rate_hz, config.perception.rate_hz)
        return chosen if self.resumed_ns is None else chosen.after(self.resumed_ns - self.shift_ns)

    def _keyframes(self, placement: Placement, due: frozenset[int]) -> Iterator[tuple[CameraFrame, Keyframe]]:
        """Frames that are due, decoded, with depth and a place in the map."""
        recording = self.recording
        sweeps = (
            None if "depth" in recording.streams else SweepDepth(recording.sweeps(), self.backends.trajectory.at_many)
        )
        frames = recording.frames(due.__contains__)
        while True:
            with self.clock.stage("decode"):
                frame = next(frames, None)
            if frame is None:
                return
            with self.clock.stage("odometry"):
                T_odom_base = self.backends.trajectory.at(frame.stamp_ns)
            if T_odom_base is None:
                self.tally.without_pose += 1
                continue
            if sweeps is not None:
                with self.clock.stage("depth"):
                    frame = sweeps.complete(frame)
            with self.clock.stage("drift"):
                T_map_base = self._without_drift(frame, placement.T_map_odom @ T_odom_base)
            yield frame, place_frame(frame, T_map_base, self.shift_ns)

    def _without_drift(self, frame: CameraFrame, T_map_base: FloatArray) -> FloatArray:
        """The base's place after what the odometry has left the map by."""
        view = None if self.drift is None else coarse_depth(frame, T_map_base)
        return T_map_base if self.drift is None or view is None else self.drift.register(view, T_map_base)

    def _perceived(self, placement: Placement) -> Iterator[tuple[Keyframe, Detections | None]]:
        """Keyframes with what the detector says of them, every detection with a mask where one can be told; `None`
        where it is not asked or says nothing.
        """
        chosen = self._choose_keyframes()
        for frame, keyframe in self._keyframes(placement, chosen.mapped):
            detections = self._perceive(frame) if frame.stamp_ns in chosen.perceived else None
            self.ahead.add(self._ahead_mark(keyframe.stamp_ns))
            yield keyframe, detections

    def _perceive(self, frame: CameraFrame) -> Detections | None:
        with self.clock.stage("detect"):
            detections = self.backends.detector.detect(frame)
        if detections is None:
            return None
        with self.clock.stage("segment"):
            return self._with_masks(frame, detections)

    def _ahead_mark(self, stamp_ns: int) -> AheadMark:
        drift = None if self.drift is None else self.drift.mark()
        return AheadMark(stamp_ns, drift, self.tally.without_pose, self.tally.detections, self.tally.masks)

    def _mapped(
        self, perceived: Iterable[tuple[Keyframe, Detections | None]], progress: Progress | None
    ) -> Iterator[MapDelta]:
        records: list[KeyframeRecord] = []
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for keyframe, detections in perceived:
            records.append(self._map(keyframe, detections, edges))
            self.tally.keyframes += 1
            self.newest_ns = keyframe.stamp_ns
            if progress is not None:
                progress(keyframe.stamp_ns - self.shift_ns, self.tally.keyframes)
            if len(records) == self.config.keyframes.batch:
                yield self._take_batch(records, edges)
                records, edges = [], {}
        if self.tally.keyframes:
            self.engine.end_traversal()
            self._relate(self.newest_ns, edges)
            yield self._take_batch(records, edges)

    def _map(
        self,
        keyframe: Keyframe,
        detections: Detections | None,
        edges: dict[tuple[int, str, int, int], SpatialEdge],
    ) -> KeyframeRecord:
        """SuperMap's loop: visibility, tracking with the map's prior, association and fusion, scene graph."""
        with self.clock.stage("visibility"):
            view = self.engine.compare_depth(keyframe, self.engine.get_neighbor_objects(keyframe))
        track_ids = None
        if detections is not None:
            self.tally.perceived += 1
            with self.clock.stage("track"):
                size = (keyframe.camera.width, keyframe.camera.height)
                track_ids = self.backends.tracker.update(detections, self.engine.update_from_map(view), size).track_ids
        with self.clock.stage("map"):
            lifted: list[LiftedDetection] = []
            if detections is not None:
                view, lifted = self.engine.unproject(view, detections, track_ids)
            matched = self.engine.obj_merge(view, lifted)
            missed = self.engine.check_semantic_consistency(view, matched, detections)
            self.engine.obj_negate(view, missed)
            self.engine.map_merge(keyframe.stamp_ns, matched)
        with self.clock.stage("graph"):
            self._relate(keyframe.stamp_ns, edges)
        with self.clock.stage("record"):
            record = self._record(keyframe, detected=detections is not None)
            self.engine.free_space.add_keyframe(self.traversal_number, keyframe, self.config.keyframes.depth_step)
        return record

    def _relate(self, stamp_ns: int, edges: dict[tuple[int, str, int, int], SpatialEdge]) -> None:
        """Bring the scene graph up to date about what has changed."""
        for edge in self.graph.update(self._nodes(), self.engine.touched, stamp_ns, self.engine.left_ns):
            edges[edge.subject, edge.relation, edge.object, edge.since_ns] = edge

    def _with_masks(self, frame: CameraFrame, detections: Detections) -> Detections:
        if any(mask is None for mask in detections.masks):
            detections = detections.with_masks(self.backends.segmenter.segment(frame, detections))
        self.tally.detections += len(detections)
        self.tally.masks += sum(mask is not None for mask in detections.masks)
        return detections

    def _nodes(self) -> dict[int, GraphNode]:
        """What stands in the map now; a node is the same as before while its object has not changed."""
        self.nodes = {
            each.number: _node(each, self.nodes.get(each.number))
            for each in self.engine.objects
            if each.confirmed and each.present and not each.demoted and not each.is_moving
        }
        return self.nodes

    def _record(self, keyframe: Keyframe, *, detected: bool) -> KeyframeRecord:
        config = self.config.keyframes
        return KeyframeRecord(
            stamp_ns=keyframe.stamp_ns,
            T_map_base=keyframe.T_map_base,
            T_map_camera=keyframe.T_map_camera,
            camera=camera_to_json(keyframe.camera),
            depth_png=encode_small_depth(keyframe, config.depth_step),
            depth_step=config.depth_step,
            thumbnail_jpeg=thumbnail(keyframe, config.thumbnail_px) if config.thumbnail_px else None,
            detected=detected,
            camera_id=keyframe.camera_id,
        )

    def _take_batch(
        self, records: list[KeyframeRecord], edges: dict[tuple[int, str, int, int], SpatialEdge]
    ) -> MapDelta:
        delta = self.engine.take_changes()
        self.tally.observations += len(delta.observations)
        self.tally.turns += len(delta.temporal_edges)
        return replace(delta, keyframes=tuple(records), spatial_edges=tuple(edges.values()))


@contextmanager
def _damage_told(where: str) -> Iterator[None]:
    try:
        yield
    except (PackingError, KeyError) as error:
        raise MemoryStoreError(
            f"the checkpoint of the stopped build is damaged: {error}", where=where, cure="begin anew with --restart"
        ) from error


def _node(standing: MapObject, before: GraphNode | None) -> GraphNode:
    """An object as the graph sees it."""
    label, shape = standing.label, standing.shape
    if before is not None and before.points is shape.points and before.label == label:
        return before
    return GraphNode(standing.number, label, shape.box, shape.points)


def place_frame(frame: CameraFrame, T_map_base: FloatArray, clock_shift_ns: int = 0) -> Keyframe:
    """A camera frame with depth, placed in the map and in its time."""
    if frame.depth_m is None:
        raise ValueError("a keyframe needs depth")
    return Keyframe(
        frame.stamp_ns + clock_shift_ns,
        frame.rgb,
        frame.depth_m,
        frame.camera,
        T_map_base @ frame.T_base_camera,
        T_map_base,
        frame.returns_camera,
        frame.camera_id,
    )


def thumbnail(keyframe: Keyframe, width_px: int) -> bytes:
    """A small JPEG of a keyframe's image."""
    height_px = max(1, round(width_px * keyframe.camera.height / keyframe.camera.width))
    small = keyframe.rgb
    while small.shape[1] >= 2 * width_px and small.shape[0] % 2 == small.shape[1] % 2 == 0:  # exact and quick
        small = np.asarray(
            cv2.resize(small, (small.shape[1] // 2, small.shape[0] // 2), interpolation=cv2.INTER_AREA), np.uint8
        )
    if small.shape[:2] != (height_px, width_px):
        small = np.asarray(cv2.resize(small, (width_px, height_px), interpolation=cv2.INTER_AREA), np.uint8)
    _, jpeg = cv2.imencode(".jpg", cv2.cvtColor(small, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 75])
    return jpeg.tobytes()
