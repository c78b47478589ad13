"""The way of a recording into the memory: one frame through every stage."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass, replace
from typing import Literal, cast

import cv2
import numpy as np

from supermap_cli.backends import choose_backends
from supermap_cli.checkpoints import (
    AheadMark,
    AheadMarks,
    BuildState,
    Cadence,
    first_difference,
    is_resumable,
    make_checkpoint,
    read_checkpoint,
)
from supermap_cli.config import BuildConfig
from supermap_cli.errors import BuildStoppedError, ConfigError, MemoryStoreError
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
from supermap_cli.mapping.snapshot import restore_drift, restore_engine
from supermap_cli.mapping.structure import coarse_depth, stored_depth
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import Checkpoint, StoredTraversal, TraversalStart
from supermap_cli.placing import Placement, place_traversal
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Recording, Resumable
from supermap_cli.recordings.lidar_depth import SweepDepth
from supermap_cli.stopping import PoliteStop
from supermap_cli.tally import Tally
from supermap_cli.time_order import TimeShift, follow_in_time
from supermap_cli.timing import StageClock, StageTiming
from supermap_cli.types.detections import Detections
from supermap_cli.types.keyframe import Keyframe
from supermap_cli.types.memory import KeyframeRecord, MapDelta, SpatialEdge
from supermap_cli.types.sensing import CameraFrame
from supermap_cli.version import __version__

Unfinished = Literal["refuse", "resume", "restart"]
"""What becomes of a build that was stopped before."""

Progress = Callable[[int, int], None]
"""Called with a keyframe's stamp in the recording and the number of keyframes mapped so far."""

_VERSIONS = {"supermap": __version__}


@dataclass(frozen=True)
class BuildSummary:
    """What one build did. `total_s` is less than the stages' sum: perception runs ahead beside mapping.

    Times in the map are the recording's plus `clock_shift_ns`. `resumed_s`: how far the recording had been mapped when
    the build went on; `None` if it began anew.
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
    resumed_s: float | None = None


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
        self.ahead = AheadMarks()
        self.cadence = Cadence(config.keyframes.checkpoint_s)
        self.spent_s: dict[str, float] = {}
        self.resumed_ns: int | None = None
        self.committed_ns = self.newest_ns = 0
        self.kept_s: float | None = None
        self._worth_keeping = True
        self.nodes: dict[int, GraphNode] = {}

    def run(
        self,
        *,
        name: str | None = None,
        align: str = "auto",
        progress: Progress | None = None,
        unfinished: Unfinished = "refuse",
        again: bool = False,
    ) -> BuildSummary:
        """Map the whole recording. What is stored already stays, whatever goes wrong.

        `unfinished` says what becomes of a build that was stopped before: it is in the way ("refuse"), goes on
        ("resume", if it was of this recording), or is taken out ("restart"). `again`: the recording may be in the map.

        Raises a `SupermapError` for a recording that cannot be mapped, and for one that would leave nothing behind;
        `BuildStoppedError` when asked to stop. What was mapped until then is kept if there is a checkpoint.
        """
        going_on = self._stopped_build(unfinished)
        if going_on is None:
            self._check_it_can_follow(name, again=again)
        traversal_id: int | None = None
        try:
            if going_on is None:
                placement = self._place(align)
                traversal_id = self._begin(placement, name, again=again)
                self._restore(placement)
            else:
                traversal_id = going_on[0].id
                placement = self._go_on(*going_on)
            with PoliteStop() as stop:
                self._map_all(traversal_id, placement, stop, progress)
            total_s = self._finish(traversal_id)
        except BaseException:  # Ctrl-C too: whatever stops the build goes on upwards
            self._leave_to_be_resumed(traversal_id)
            raise
        return self._summary(traversal_id, placement, total_s)

    def _map_all(self, traversal_id: int, placement: Placement, stop: PoliteStop, progress: Progress | None) -> None:
        """Every keyframe, committed in batches."""
        with self._ahead(self._perceived(placement)) as perceived:
            for batch in self._batches(self.late.settled(perceived), progress):
                if self._was_committed(batch):
                    continue
                checkpoint = self._checkpoint(placement, wanted=stop.requested)
                with self.clock.stage("write"):
                    self.store.commit(traversal_id, batch, checkpoint)
                self._tell_viewers(batch)
                if stop.requested:
                    raise BuildStoppedError(
                        f"stopped at {self._mapped_s():.1f} s of {self._recorded_s():.1f} s",
                        where=str(self.recording.path),
                        cure="what is mapped so far is kept: go on with --resume, or begin anew with --restart",
                    )

    def _was_committed(self, batch: MapDelta) -> bool:
        """Whether a former run of this build had written this batch already. The last one, that holds no keyframes, may
        be written twice: it only says what things are like at the end.
        """
        return bool(batch.keyframes) and batch.keyframes[-1].stamp_ns <= self.committed_ns

    def _finish(self, traversal_id: int) -> float:
        """The traversal is in the map for good. Returns the seconds that this took, in all."""
        self._worth_keeping = False
        self.tally.check_something_came_of_it(str(self.recording.path), self.backends.names["detector"])
        self._worth_keeping = True
        total_s = time.perf_counter() - self.began
        self.store.finish_traversal(traversal_id, self._spent_s())
        return total_s

    def _leave_to_be_resumed(self, traversal_id: int | None) -> None:
        """The build was stopped: what it wrote is kept if it can go on, else it goes. A full disk does not let it go
        now; the next build asks what is to become of it.
        """
        with suppress(MemoryStoreError):
            if traversal_id is not None and self._worth_keeping and self.store.checkpoint(traversal_id) is not None:
                self.kept_s = self._mapped_s()
                return
            if traversal_id is not None:
                self.store.discard_traversal(traversal_id)
            self.store.discard_if_created()

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

    def _stopped_build(self, unfinished: Unfinished) -> tuple[StoredTraversal, Checkpoint] | None:
        """Before any work: the stopped build that goes on; `None` if there is none, or it is begun anew."""
        where, fingerprint = str(self.recording.path), self.recording.fingerprint()
        stopped = self.store.unfinished()
        if stopped is None:
            return None
        if unfinished == "resume" and stopped.fingerprint == fingerprint:
            self._check_it_is_built_alike(stopped)
            checkpoint = self.store.checkpoint(stopped.id) if is_resumable(self.backends.tracker) else None
            if checkpoint is not None:
                return stopped, checkpoint
        elif unfinished != "restart":
            what, cure = _in_the_way(stopped, fingerprint)
            raise MemoryStoreError(what, where=where, cure=cure)
        self.store.take_out_unfinished()
        self.warnings.append(f"the build of {stopped.name!r} had been stopped: what it had written was taken out")
        return None

    def _check_it_is_built_alike(self, stopped: StoredTraversal) -> None:
        now = {"build": self._config(), "versions": _VERSIONS}
        begun_with = {entry: value for entry, value in stopped.config.items() if entry != "placed"}
        before = {"build": begun_with, "versions": dict(stopped.versions)}
        difference = first_difference(before, now)
        if difference is not None:
            raise ConfigError(
                f"the build of {stopped.name!r} was begun otherwise: {difference}",
                where=str(self.recording.path),
                cure="go on with the settings it was begun with, or begin anew with --restart",
            )

    def _check_it_can_follow(self, name: str | None, *, again: bool) -> None:
        """Before any work: a recording enters once, and the map's time goes forward."""
        where = str(self.recording.path)
        self.store.check_is_new(where, self.recording.fingerprint(), name, again=again)
        self._go_on_in_time(follow_in_time(self.recording, name or self.recording.path.stem, self.store.traversals()))

    def _go_on_in_time(self, time: TimeShift) -> None:
        """From here on keyframes have the map's time, the recording's own plus a shift; all before them has its own."""
        self.time, self.late.clock_shift_ns = time, time.shift_ns
        if time.warning is not None:
            self.warnings.append(time.warning)

    def _place(self, align: str) -> Placement:
        with self.clock.stage("place"):
            return place_traversal(self.recording, self.backends.trajectory, self.store, align)

    def _config(self) -> dict[str, object]:
        """All settings that the map depends on, as they are stored."""
        return {**self.config.model_dump(mode="json"), "used": self.backends.names}

    def _begin(self, placement: Placement, name: str | None, *, again: bool) -> int:
        start = TraversalStart(
            recording=str(self.recording.path),
            fingerprint=self.recording.fingerprint(),
            start_ns=self.recording.start_ns + self.time.shift_ns,
            end_ns=self.recording.end_ns + self.time.shift_ns,
            T_map_odom=placement.T_map_odom,
            config={**self._config(), "placed": placement.method},
            versions=_VERSIONS,
            name=name,
            clock_shift_ns=self.time.shift_ns,
        )
        return self.store.begin_traversal(start, again=again)

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
            self._relate_from(self.store.load_spatial_edges(open_only=True))

    def _go_on(self, stopped: StoredTraversal, checkpoint: Checkpoint) -> Placement:
        """Bring every stage to where it was at the checkpoint."""
        with self.clock.stage("restore"):
            self.engine = MappingEngine(self.config.mapping, frozenset(self.config.ablate))
            restore_engine(self.engine, checkpoint.parts["engine"])
            self.drift = restore_drift(checkpoint.parts["drift"]) if "drift" in checkpoint.parts else None
            for traversal in self.store.traversals():
                until_ns = checkpoint.stamp_ns if traversal.id == stopped.id else None
                for record in self.store.keyframe_depths([traversal.id], until_ns=until_ns):
                    self.engine.free_space.recall(traversal.number, record)
            state = read_checkpoint(checkpoint)
            self.tally, self.spent_s = state.tally, state.spent_s
            cast("Resumable", self.backends.tracker).resume(state.tracker)
            self.resumed_ns, self.committed_ns = checkpoint.stamp_ns, stopped.mapped_ns or checkpoint.stamp_ns
            self._go_on_in_time(TimeShift(stopped.clock_shift_ns))
            self._relate_from(state.held_edges)
        return state.placement

    def _relate_from(self, held: Iterable[SpatialEdge]) -> None:
        """The scene graph goes on from open relations."""
        self.traversal_number = max((each.number for each in self.store.traversals()), default=1)
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
        return chosen if self.resumed_ns is None else chosen.after(self.resumed_ns - self.time.shift_ns)

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

    def _batches(
        self, perceived: Iterable[tuple[Keyframe, Detections | None]], progress: Progress | None
    ) -> Iterator[MapDelta]:
        """Map keyframes, and hand over what a batch of whole ones has changed."""
        records: list[KeyframeRecord] = []
        edges: dict[tuple[int, str, int, int], SpatialEdge] = {}
        for keyframe, detections in perceived:
            records.append(self._map(keyframe, detections, edges))
            self.tally.keyframes += 1
            self.newest_ns = keyframe.stamp_ns
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

    def _checkpoint(self, placement: Placement, *, wanted: bool) -> Checkpoint | None:
        """The state of every stage after the batch that was mapped, if it is time for it, or it is wanted."""
        mark = self.ahead.take(self.newest_ns)
        if not (wanted or self.cadence.due()) or not is_resumable(self.backends.tracker):
            return None
        began = time.monotonic()
        with self.clock.stage("checkpoint"):
            tracker = cast("Resumable", self.backends.tracker).state()
            state = BuildState(placement, self.tally, self._spent_s(), list(self.graph.held.values()), tracker)
            checkpoint = make_checkpoint(mark, state, self.engine, self.drift)
        self.cadence.written(began)
        return checkpoint

    def _spent_s(self) -> dict[str, float]:
        """Seconds by stage, those of former runs of this build included."""
        now_s = {each.stage: each.total_s for each in self.clock.timings()}
        spent_s = {stage: self.spent_s.get(stage, 0.0) + now_s.get(stage, 0.0) for stage in {**self.spent_s, **now_s}}
        return {**spent_s, "total": self.spent_s.get("total", 0.0) + time.perf_counter() - self.began}

    def _mapped_s(self) -> float:
        return max(0.0, self._since_start_s(self.newest_ns))

    def _since_start_s(self, stamp_ns: int) -> float:
        """Seconds from the recording's start to a time of the map."""
        return (stamp_ns - self.time.shift_ns - self.recording.start_ns) / 1e9

    def _recorded_s(self) -> float:
        return (self.recording.end_ns - self.recording.start_ns) / 1e9

    # -- after the last frame

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
            self._recorded_s(),
            total_s,
            len(standing),
            tuple(warnings),
            self.time.shift_ns,
            None if self.resumed_ns is None else self._since_start_s(self.resumed_ns),
        )


def _in_the_way(stopped: StoredTraversal, fingerprint: str) -> tuple[str, str]:
    """What to say of a stopped build that is neither to go on nor to be taken out, and the cure."""
    done = 0.0 if stopped.mapped_ns is None else (stopped.mapped_ns - stopped.start_ns)
    share = f"{100 * done / max(stopped.end_ns - stopped.start_ns, 1):.0f} %"
    if stopped.fingerprint == fingerprint:
        return f"its build was stopped at {share}", "go on with --resume, or begin anew with --restart"
    return (
        f"the build of {stopped.name!r} was stopped at {share}",
        f"let it end first (supermap build {stopped.recording} --resume), or take out what it wrote (--restart)",
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
