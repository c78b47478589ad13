"""The way of a recording into the memory: one frame through every stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from supermap_cli.backends import choose_backends
from supermap_cli.config import BuildConfig
from supermap_cli.errors import DetectorError, OdometryError, RecordingError
from supermap_cli.geometry.arrays import FloatArray
from supermap_cli.geometry.cameras import camera_to_json
from supermap_cli.graph.predicates import PREDICATES, GraphNode
from supermap_cli.graph.scene_graph import SceneGraph
from supermap_cli.keyframe_choice import KeyframeChoice, choose_keyframes
from supermap_cli.late_results import LateResults
from supermap_cli.lookahead import LookAhead
from supermap_cli.mapping.drift import DriftCorrection
from supermap_cli.mapping.engine import MappingEngine
from supermap_cli.mapping.free_space import encode_small_depth
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.mapping.structure import coarse_depth, stored_depth
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import TraversalStart
from supermap_cli.placing import Placement, place_traversal
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Recording
from supermap_cli.recordings.lidar_depth import SweepDepth
from supermap_cli.time_order import TimeShift, follow_in_time
from supermap_cli.timing import StageClock, StageTiming
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta, SpatialEdge
from supermap_cli.types.sensing import CameraFrame
from supermap_cli.version import __version__

Progress = Callable[[int, int], None]
"""Called with a keyframe's stamp in the recording and the number of keyframes mapped so far."""


@dataclass
class Tally:
    """What came through each stage: told when a build ends empty. `turns` are things that came, went or moved."""

    frames: int = 0
    without_pose: int = 0
    keyframes: int = 0
    perceived: int = 0
    detections: int = 0
    masks: int = 0
    observations: int = 0
    turns: int = 0
    labels: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class BuildSummary:
    """What one build did. `total_s` is less than the stages' sum: perception runs ahead beside mapping. Times in the
    map are the recording's plus `clock_shift_ns`.
    """

    traversal_id: int
    traversal: str
    tally: Tally
    placement: Placement
    timings: tuple[StageTiming, ...]
    backends: dict[str, str]
    recorded_s: float
    total_s: float
    instances: int
    warnings: tuple[str, ...]
    clock_shift_ns: int = 0


class TraversalBuild:
    """Builds one traversal into the memory; `run` reads like the method."""

    def __init__(
        self,
        recording: Recording,
        plugins: Plugins,
        config: BuildConfig,
        store: MapStore,
        began: float | None = None,
        *,
        clock: StageClock | None = None,
        look_ahead: bool = True,
    ) -> None:
        """`began` is the `time.perf_counter` from which the build's time counts, if the recording was opened for it.

        `clock` goes on with the times of earlier traversals; without `look_ahead` one stage runs at a time.
        """
        self.began = time.perf_counter() if began is None else began
        self.recording = recording
        self.plugins = plugins
        self.config = config
        self.store = store
        self.clock = StageClock() if clock is None else clock
        self.look_ahead = look_ahead
        self.tally = Tally()
        self.backends = choose_backends(recording, plugins, config)
        self.viewers = [each for each in plugins.working if "keyframe_mapped" in each.hooks]
        self.late = LateResults(config.perception)
        self.time = TimeShift()
        self.warnings: list[str] = []
        self.nodes: dict[int, GraphNode] = {}

    def run(self, *, name: str | None = None, align: str = "auto", progress: Progress | None = None) -> BuildSummary:
        """Map the whole recording. Whatever goes wrong, the memory is as it was before.

        Raises a `SupermapError` for a recording that cannot be mapped, and for one that would leave nothing behind.
        """
        self._check_it_can_follow(name)
        placement = self._place(align)
        traversal_id = self._begin(placement, name)
        try:
            self._restore(placement)
            with self._ahead(self._perceived(placement)) as perceived:
                for batch in self._batches(self.late.settled(perceived), progress):
                    with self.clock.stage("write"):
                        self.store.commit(traversal_id, batch)
                    self._tell_viewers(batch)
            self._check_something_came_of_it()
            total_s = time.perf_counter() - self.began
            seconds = {each.stage: each.total_s for each in self.clock.timings()}
            self.store.finish_traversal(traversal_id, {**seconds, "total": total_s})
        except BaseException:  # Ctrl-C too: whatever stops the build, it is undone, and goes on upwards
            self.store.discard_traversal(traversal_id)
            self.store.discard_if_created()
            raise
        return self._summary(traversal_id, placement, total_s)

    def _ahead(
        self, perceived: Iterator[tuple[Keyframe, Detections | None]]
    ) -> AbstractContextManager[Iterable[tuple[Keyframe, Detections | None]]]:
        return LookAhead(perceived) if self.look_ahead else nullcontext(perceived)

    def _tell_viewers(self, batch: MapDelta) -> None:
        """Call `keyframe_mapped` for what was committed. A viewer that fails is told off and called no more."""
        for viewer in list(self.viewers):
            try:
                for keyframe in batch.keyframes:
                    viewer.hook.keyframe_mapped(keyframe=keyframe, changes=batch)
            except Exception as error:  # a viewer's fault must not cost the map
                self.viewers.remove(viewer)
                self.warnings.append(f"plugin {viewer.name} was left out: {type(error).__name__}: {error}")

    # -- before the first frame

    def _check_it_can_follow(self, name: str | None) -> None:
        """Before any work: what a killed build left goes, a recording enters once, and the map's time goes forward."""
        for killed in self.store.take_out_unfinished():
            self.warnings.append(f"the build of {killed!r} had been killed: what it had written was taken out")
        where = str(self.recording.path)
        self.store.check_is_new(where, self.recording.fingerprint(), name)
        self._go_on_in_time(follow_in_time(self.recording, name or self.recording.path.stem, self.store.traversals()))

    def _go_on_in_time(self, time: TimeShift) -> None:
        """From here on keyframes have the map's time, the recording's own plus a shift; all before them has its own."""
        self.time, self.late.clock_shift_ns = time, time.shift_ns
        if time.warning is not None:
            self.warnings.append(time.warning)

    def _place(self, align: str) -> Placement:
        with self.clock.stage("place"):
            return place_traversal(self.recording, self.backends.trajectory, self.store, align)

    def _begin(self, placement: Placement, name: str | None) -> int:
        start = TraversalStart(
            recording=str(self.recording.path),
            fingerprint=self.recording.fingerprint(),
            start_ns=self.recording.start_ns + self.time.shift_ns,
            end_ns=self.recording.end_ns + self.time.shift_ns,
            T_map_odom=placement.T_map_odom,
            config={**self.config.model_dump(mode="json"), "used": self.backends.names, "placed": placement.method},
            versions={"supermap": __version__},
            name=name,
            clock_shift_ns=self.time.shift_ns,
        )
        return self.store.begin_traversal(start)

    def _restore(self, placement: Placement) -> None:
        """Go on from what earlier traversals left: objects, open relations, and which space was seen empty when."""
        with self.clock.stage("restore"):
            objects = restore_objects(self.store.load_instances(), self.store.next_object_number())
            self.engine = MappingEngine(self.config.mapping, frozenset(self.config.ablate), objects)
            self.engine.floor_z = placement.floor_z
            self.drift = DriftCorrection() if self.config.mapping.correct_drift else None
            for traversal in self.store.traversals():
                for record in self.store.keyframe_depths([traversal.id]):
                    self.engine.free_space.recall(traversal.number, record)
                    if self.drift is not None:
                        self.drift.remember(stored_depth(record))
            self.traversal_number = max((each.number for each in self.store.traversals()), default=1)
            further = [each for group in self.plugins.hook.spatial_predicates() for each in group]
            self.graph = SceneGraph((*PREDICATES, *further))
            self.graph.resume(self.store.load_spatial_edges(open_only=True))
            self.engine.objects.bounds()
            self._nodes()

    # -- the way of one frame

    def _choose_keyframes(self) -> KeyframeChoice:
        stamps_ns, able_ns = self.recording.frame_stamps_ns(), self.backends.detector.image_stamps_ns()
        self.tally.frames = len(stamps_ns)
        config = self.config
        return choose_keyframes(stamps_ns, able_ns, config.keyframes.rate_hz, config.perception.rate_hz)

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
            yield frame, place_frame(frame, T_map_base, self.time.shift_ns)

    def _without_drift(self, frame: CameraFrame, T_map_base: FloatArray) -> FloatArray:
        """The base's place after what the odometry has left the map by."""
        view = None if self.drift is None else coarse_depth(frame, T_map_base)
        return T_map_base if self.drift is None or view is None else self.drift.place(view, T_map_base)

    def _perceived(self, placement: Placement) -> Iterator[tuple[Keyframe, Detections | None]]:
        """Keyframes with what the detector says of them, every detection with a mask where one can be told; `None`
        where it is not asked or says nothing.
        """
        chosen = self._choose_keyframes()
        for frame, keyframe in self._keyframes(placement, chosen.mapped):
            if frame.stamp_ns not in chosen.perceived:
                yield keyframe, None
                continue
            with self.clock.stage("detect"):
                detections = self.backends.detector.detect(frame)
            if detections is not None:
                with self.clock.stage("segment"):
                    detections = self._with_masks(frame, detections)
            yield keyframe, detections

    def _batches(
        self, perceived: Iterable[tuple[Keyframe, Detections | None]], progress: Progress | None
    ) -> Iterator[MapDelta]:
        """Map keyframes, and hand over what a batch of whole ones has changed."""
        records: list[KeyframeRecord] = []
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for keyframe, detections in perceived:
            records.append(self._map(keyframe, detections, edges))
            self.tally.keyframes += 1
            if progress is not None:
                progress(keyframe.stamp_ns - self.time.shift_ns, self.tally.keyframes)
            if len(records) == self.config.keyframes.batch:
                yield self._take_batch(records, edges)
                records, edges = [], {}
        if self.tally.keyframes:
            self.engine.leave()
            self._relate(keyframe.stamp_ns, edges)
            yield self._take_batch(records, edges)

    def _map(
        self,
        keyframe: Keyframe,
        detections: Detections | None,
        edges: dict[tuple[int, str, int, int], SpatialEdge],
    ) -> KeyframeRecord:
        """SuperMap's loop: visibility, tracking with the map's prior, association and fusion, scene graph."""
        with self.clock.stage("visibility"):
            look = self.engine.look(keyframe)
        track_ids = None
        if detections is not None:
            self.tally.perceived += 1
            with self.clock.stage("track"):
                size = (keyframe.camera.width, keyframe.camera.height)
                track_ids = self.backends.tracker.update(detections, self.engine.track_priors(look), size).track_ids
        with self.clock.stage("map"):
            self.engine.integrate(look, detections, track_ids)
        with self.clock.stage("graph"):
            self._relate(keyframe.stamp_ns, edges)
        with self.clock.stage("record"):
            record = self._record(keyframe, detected=detections is not None)
            self.engine.free_space.look(self.traversal_number, keyframe, self.config.keyframes.depth_step)
        return record

    def _relate(self, stamp_ns: int, edges: dict[tuple[int, str, int, int], SpatialEdge]) -> None:
        """Bring the scene graph up to date about what has changed."""
        for edge in self.graph.update(self._nodes(), self.engine.touched, stamp_ns):
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
            if each.confirmed and each.present and not each.doubted and not each.on_the_move
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
        )

    def _take_batch(
        self, records: list[KeyframeRecord], edges: dict[tuple[int, str, int, int], SpatialEdge]
    ) -> MapDelta:
        delta = self.engine.take_changes()
        self.tally.observations += len(delta.observations)
        self.tally.turns += len(delta.temporal_edges)
        return replace(delta, keyframes=tuple(records), spatial_edges=tuple(edges.values()))

    # -- after the last frame

    def _check_something_came_of_it(self) -> None:
        """A build never ends silently empty: say at which stage everything was lost, and what helps."""
        tally, where = self.tally, str(self.recording.path)
        if tally.keyframes == 0 and tally.without_pose:
            raise OdometryError(
                f"none of {tally.without_pose} images has a pose",
                where=where,
                cure="see in `supermap inspect` what the odometry covers, or choose another --odometry",
            )
        if tally.keyframes == 0:
            raise RecordingError(
                "no image could be mapped", where=where, cure="see `supermap inspect` for what is missing"
            )
        if tally.observations or tally.turns:
            return
        detector = self.backends.names["detector"]
        if tally.detections == 0:
            raise DetectorError(
                f"the detector {detector!r} found nothing in {tally.perceived} images",
                where=where,
                cure="try another model or a lower score (--option, see `supermap plugins`)",
            )
        raise RecordingError(
            f"nothing could be mapped: {tally.detections} detections in {tally.keyframes} images, "
            f"{tally.masks} with a mask, no object confirmed",
            where=where,
            cure="check the depth (`supermap inspect`), or map more images with --rate",
        )

    def _summary(self, traversal_id: int, placement: Placement, total_s: float) -> BuildSummary:
        standing = [each for each in self.engine.objects if each.confirmed and each.present and not each.doubted]
        for each in sorted(standing, key=lambda o: o.label):
            self.tally.labels[each.label] = self.tally.labels.get(each.label, 0) + 1
        name = next(each.name for each in self.store.traversals() if each.id == traversal_id)
        warnings = [*self.recording.warnings, *placement.warnings, *self.warnings]
        if self.tally.without_pose:
            warnings.append(f"{self.tally.without_pose} images had no pose and were left out")
        if self.late.too_late:
            warnings.append(
                f"the detections of {self.late.too_late} images came over {self.config.perception.wait_s:g} s late "
                "and were left out (build.perception.wait_s)"
            )
        return BuildSummary(
            traversal_id,
            name,
            self.tally,
            placement,
            self.clock.timings(),
            self.backends.names,
            (self.recording.end_ns - self.recording.start_ns) / 1e9,
            total_s,
            len(standing),
            tuple(warnings),
            self.time.shift_ns,
        )


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
