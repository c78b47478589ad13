"""Builds one traversal: started or resumed, committed in batches, left complete, resumable, or removed."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing, suppress

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.backends import choose_backends
from supermap_cli.drivers.bag import BagDriver, Position
from supermap_cli.drivers.build_summary import BuildSummary, present_labels, session_summary
from supermap_cli.drivers.checkpoints import (
    CheckpointSchedule,
    make_checkpoint,
    restore_session,
)
from supermap_cli.drivers.duplicate_windows import check_no_overlap
from supermap_cli.drivers.graceful_interrupt import GracefulInterrupt
from supermap_cli.drivers.prior_map import earlier_traversals, load_prior_map, stored_keyframes
from supermap_cli.drivers.stopped_builds import (
    Continuation,
    Unfinished,
    check_built_alike,
    damage_reported,
    find_stopped,
    load_continuation,
)
from supermap_cli.errors import BuildStoppedError, MemoryStoreError
from supermap_cli.memory.names import traversal_name
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.time_order import follow_in_time
from supermap_cli.memory.values import Checkpoint, StoredTraversal, TraversalStart
from supermap_cli.observing import Observers
from supermap_cli.parameters import stored_config
from supermap_cli.plugin_manager import Plugins, make_observers
from supermap_cli.protocols import Observer, Recording, WarningDetector
from supermap_cli.relations.map_relations import CONFIG_ENTRY, described
from supermap_cli.session import MappingSession
from supermap_cli.stages.map_registration import Placement
from supermap_cli.stages.session_state import SessionBackends, SessionState, begin
from supermap_cli.timing import StageClock
from supermap_cli.types.memory import MapDelta, coalesce
from supermap_cli.types.relations import SpatialRelation
from supermap_cli.types.session import SessionContext
from supermap_cli.version import __version__

Progress = Callable[[int, int], None]
"""Called with a keyframe's stamp in the recording and the number of keyframes mapped so far."""

_VERSIONS = {"supermap": __version__}


class TraversalBuild:
    """Builds one traversal into the memory: a `BagDriver` pushes into a `MappingSession`, what comes out is stored."""

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
        viewers: Mapping[str, str] | None = None,
    ) -> None:
        """`began` is the `time.perf_counter` from which the build's time counts, if the recording was opened for it.

        `clock` goes on with the times of earlier traversals; without `look_ahead` one stage runs at a time. `viewers`
        are those that the user asked for (see `SessionContext`).
        """
        self.began = time.perf_counter() if began is None else began
        self.recording = recording
        self.config = config
        self.store = store
        self.clock = StageClock() if clock is None else clock
        self.plugins = plugins
        self.backends = choose_backends(recording, plugins, config)
        self.driver = BagDriver(recording, self.backends, config, self.clock, look_ahead=look_ahead)
        self.viewers = dict(viewers or {})
        self.observers = Observers()
        self.session: MappingSession | None = None
        self.checkpoint_schedule = CheckpointSchedule(config.keyframes.checkpoint_s)
        self.align = "auto"
        self.shift_ns = 0
        self.warnings: list[str] = []
        self.empty_warnings: tuple[str, ...] = ()
        self.spent_s: dict[str, float] = {}
        self.resumed_ns: int | None = None
        self.kept_s: float | None = None
        self._committed = 0
        self._keep_on_failure = True

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
        self.align = align
        stopped = self._stopped_build(unfinished, name)
        continuation = None if stopped is None else self._continuation_of(stopped, unfinished)
        replaced = None if stopped is None or continuation is not None else stopped.id
        again = again or (stopped is not None and stopped.fingerprint == self.recording.fingerprint())
        if continuation is None:
            self._check_is_new(name, replaced, again=again)
        traversal_id: int | None = None
        complete = False
        try:
            if continuation is None:
                placement = self._place(replaced)
                self._roll_back(replaced)
                traversal_id = self._begin(placement, name, again=again)
                session = self._open_session(traversal_id, self._new_state(traversal_id, placement))
            else:
                traversal_id = continuation.traversal.id
                session = self._open_session(traversal_id, self._restore(continuation))
            after = None if continuation is None else continuation.stopped.position
            with GracefulInterrupt() as interrupt:
                self._map_all(traversal_id, session, after, interrupt, progress)
            total_s = self._finish(traversal_id, session)
            complete = True
        except BaseException:  # Ctrl-C too: whatever stops the build goes on upwards
            self._leave_resumable(traversal_id)
            raise
        finally:
            self._end_observers(complete=complete)
        return self._summary(traversal_id, session, total_s)

    def _map_all(
        self,
        traversal_id: int,
        session: MappingSession,
        after: Position | None,
        interrupt: GracefulInterrupt,
        progress: Progress | None,
    ) -> None:
        """Every keyframe, committed in batches."""
        with closing(self._batches(session, after, progress)) as batches:
            for batch in batches:
                if self._was_committed(session, batch):
                    continue
                stopping = interrupt.requested
                checkpoint = self._checkpoint(session, wanted=stopping)
                with self.clock.stage("write"):
                    self.store.commit(traversal_id, batch, checkpoint)
                self.observers.committed(batch)
                if stopping:
                    raise BuildStoppedError(
                        f"stopped at {self._mapped_s():.1f} s of {self._recorded_s():.1f} s",
                        where=str(self.recording.path),
                        cure="its tracker has no checkpoints, so nothing of it is kept"
                        if checkpoint is None
                        else "what is mapped so far is kept: go on with --resume, or begin anew with --restart",
                    )

    def _batches(
        self, session: MappingSession, after: Position | None, progress: Progress | None
    ) -> Generator[MapDelta]:
        """What batches of whole keyframes changed; keyframes of several cameras with one stamp stay together."""
        one_camera, size = len(self.recording.cameras) == 1, self.config.keyframes.batch
        deltas: list[MapDelta] = []
        with closing(self.driver.push_into(session, after)) as pushes:
            for mapped in pushes:
                for delta in mapped:
                    deltas.append(delta)
                    self._report_progress(session, delta, progress)
                    if one_camera and len(deltas) == size and delta.keyframes:
                        yield coalesce(deltas)
                        deltas = []
                if len(deltas) >= size and deltas[-1].keyframes:
                    yield coalesce(deltas)
                    deltas = []
        if deltas:
            yield coalesce(deltas)

    def _report_progress(self, session: MappingSession, delta: MapDelta, progress: Progress | None) -> None:
        self.observers.muted = session.statistics.keyframes < self._committed
        if progress is not None and delta.keyframes and session.newest is not None:
            progress(session.newest.frame.stamp_ns, session.statistics.keyframes)

    def _checkpoint(self, session: MappingSession, *, wanted: bool) -> Checkpoint | None:
        """What the build could go on from after this batch, if it is time for that, or wanted."""
        if not (wanted or self.checkpoint_schedule.due()) or not self.backends.resumable or session.newest is None:
            return None
        began = time.monotonic()
        with self.clock.stage("checkpoint"):
            checkpoint = make_checkpoint(session, self._spent_s())
        self.checkpoint_schedule.written(began)
        return checkpoint

    def _was_committed(self, session: MappingSession, batch: MapDelta) -> bool:
        """Whether a former run of this build had written this batch already. The last one, that holds no keyframes, may
        be written twice: it only says what things are like at the end.
        """
        return bool(batch.keyframes) and session.statistics.keyframes <= self._committed

    def _finish(self, traversal_id: int, session: MappingSession) -> float:
        """The traversal is in the map for good. Returns the seconds that this took, in all."""
        self._keep_on_failure = False
        session.statistics.frames = self.driver.frames
        self._check_not_empty(traversal_id, session)
        self._keep_on_failure = True
        total_s = time.perf_counter() - self.began
        self.store.finish_traversal(
            traversal_id,
            self._spent_s(),
            self._stored_warnings(session),
            learnt={"detector_recall": session.engine.recall.by_class()},
        )
        return total_s

    def _check_not_empty(self, traversal_id: int, session: MappingSession) -> None:
        """Raise where the build has no result; a first visit to an empty place is one, with a warning."""
        statistics, name = session.statistics, self.backends.names["detector"]
        statistics.tentative = sum(not obj.confirmed for obj in session.engine.objects)
        warning = statistics.check_not_empty(
            str(self.recording.path),
            name,
            self.driver.late.lost,
            first_visit=all(traversal.id == traversal_id for traversal in self.store.traversals()),
            detections_recorded="detections" in self.plugins.detectors.get(name).needs,
        )
        if warning is not None:
            self.empty_warnings = (warning,)

    def _leave_resumable(self, traversal_id: int | None) -> None:
        """The build was stopped: what it wrote is kept if it can go on, else it goes. A full disk does not let it go
        now; the next build asks what is to become of it.
        """
        with suppress(MemoryStoreError):
            self.store.check_place()
            if traversal_id is not None and self._keep_on_failure and self.store.checkpoint(traversal_id) is not None:
                mapped = self.session is not None and self.session.newest is not None
                self.kept_s = self._mapped_s() if mapped else None
                return
            if traversal_id is not None:
                self.store.discard_traversal(traversal_id)
            self.store.discard_if_created()

    # -- session and observers

    def _open_session(self, traversal_id: int, state: SessionState) -> MappingSession:
        further = self._further_relations()
        context = self._context(traversal_id, state)
        self.observers = Observers(self._made_observers(context))
        self.observers.started(context)
        self.observers.muted = state.statistics.keyframes < self._committed
        self.session = MappingSession(
            self.config,
            SessionBackends(self.backends.make_tracker, predicates=further, detector=self.backends.detector_identity),
            state,
            observers=self.observers,
            clock=self.clock,
            clock_shift_ns=self.shift_ns,
        )
        return self.session

    def _further_relations(self) -> tuple[SpatialRelation, ...]:
        return self.plugins.spatial_predicates()

    def _context(self, traversal_id: int, state: SessionState) -> SessionContext:
        return SessionContext(
            str(self.recording.path),
            self.store.where,
            self._traversal_name(traversal_id),
            self.recording.cameras,
            self.backends.names,
            None if state.placement is None else state.placement.T_map_odom,
            self.shift_ns,
            self.viewers,
        )

    def _made_observers(self, context: SessionContext) -> list[tuple[str, Observer]]:
        made, warnings = make_observers(self.plugins, context)
        self.warnings += warnings
        return made

    def _end_observers(self, *, complete: bool) -> None:
        if self.session is not None:
            self.observers.ended(session_summary(self.session, self._all_warnings(self.session), complete=complete))
        self.warnings += self.observers.close()

    # -- before the first frame

    def _stopped_build(self, unfinished: Unfinished, name: str | None) -> StoredTraversal | None:
        """Before any work: a build that was stopped before, and is to go on or to be replaced by this one."""
        stopped = find_stopped(self.store, self.recording, unfinished)
        if stopped is not None and unfinished == "resume":
            now = {"build": self._config(), "versions": _VERSIONS, "name": name or stopped.name}
            check_built_alike(stopped, now, str(self.recording.path))
        return stopped

    def _continuation_of(self, stopped: StoredTraversal, unfinished: Unfinished) -> Continuation | None:
        """What a stopped build goes on from; `None` where it is to begin anew, or has no checkpoint."""
        if unfinished == "restart" or not self.backends.resumable:
            return None
        return load_continuation(self.store, stopped)

    def _check_is_new(self, name: str | None, replaced: int | None, *, again: bool) -> None:
        """Before any work: a recording enters once, and the map's time goes forward."""
        where = str(self.recording.path)
        self.store.check_is_new(where, self.recording.fingerprint(), name, again=again, without=replaced)
        earlier = [traversal for traversal in self.store.traversals() if traversal.id != replaced]
        if not again:
            check_no_overlap(self.recording, earlier)
        self._shift_times(name, earlier)

    def _roll_back(self, replaced: int | None) -> None:
        """What a stopped build wrote goes, now that nothing stands in the way of the one that replaces it."""
        if replaced is not None:
            for stopped in self.store.roll_back_unfinished():
                self.warnings.append(f"the build of {stopped!r} had been stopped: what it had written was taken out")

    def _shift_times(self, name: str | None, earlier: Sequence[StoredTraversal]) -> None:
        """The map's time goes forward, whatever the recording's clock says."""
        name = name or traversal_name(str(self.recording.path), {traversal.name for traversal in earlier})
        shift = follow_in_time(self.recording, name, earlier)
        self.shift_ns = shift.shift_ns
        if shift.warning is not None:
            self.warnings.append(shift.warning)

    def _place(self, replaced: int | None) -> Placement:
        with self.clock.stage("place"):
            structure = self.driver.parameters.structure
            return self.driver.place(self.align, earlier_traversals(self.store, structure, without=replaced))

    def _config(self) -> dict[str, object]:
        """All settings that the map depends on, as they are stored."""
        return {
            **stored_config(self.config),
            "used": self.backends.names,
            "detector": self.backends.detector_identity,
            "align": self.align,
            CONFIG_ENTRY: described(self._further_relations()),
        }

    def _begin(self, placement: Placement, name: str | None, *, again: bool) -> int:
        start = TraversalStart(
            recording=str(self.recording.path),
            fingerprint=self.recording.fingerprint(),
            start_ns=self.recording.start_ns + self.shift_ns,
            end_ns=self.recording.end_ns + self.shift_ns,
            T_map_odom=placement.T_map_odom,
            config={**self._config(), "placed": placement.method},
            versions=_VERSIONS,
            name=name,
            clock_shift_ns=self.shift_ns,
        )
        return self.store.begin_traversal(start, again=again)

    def _new_state(self, traversal_id: int, placement: Placement) -> SessionState:
        with self.clock.stage("restore"):
            return begin(self.config, load_prior_map(self.store, traversal_id), placement)

    def _restore(self, continuation: Continuation) -> SessionState:
        """The state at a stopped build's checkpoint. Raises `MemoryStoreError` where it is damaged."""
        traversal, checkpoint, stopped = continuation.traversal, continuation.checkpoint, continuation.stopped
        self.spent_s = stopped.spent_s
        self.shift_ns = traversal.clock_shift_ns
        self.resumed_ns = checkpoint.stamp_ns
        self._committed = traversal.keyframes
        keyframes = stored_keyframes(self.store, last=traversal.id, until_ns=checkpoint.stamp_ns)
        with self.clock.stage("restore"), damage_reported(self.store.where):
            return restore_session(self.config, checkpoint, stopped, traversal.number, keyframes)

    # -- after the last frame

    def _spent_s(self) -> dict[str, float]:
        """Seconds by stage, those of former runs of this build included."""
        now_s = {timing.stage: timing.total_s for timing in self.clock.timings()}
        spent_s = {stage: self.spent_s.get(stage, 0.0) + now_s.get(stage, 0.0) for stage in {**self.spent_s, **now_s}}
        return {**spent_s, "total": self.spent_s.get("total", 0.0) + time.perf_counter() - self.began}

    def _mapped_s(self) -> float:
        newest = None if self.session is None else self.session.newest
        return 0.0 if newest is None else max(0.0, self._since_start_s(newest.keyframe.stamp_ns))

    def _since_start_s(self, stamp_ns: int) -> float:
        """Seconds from the recording's start to a time of the map."""
        return (stamp_ns - self.shift_ns - self.recording.start_ns) / 1e9

    def _recorded_s(self) -> float:
        return (self.recording.end_ns - self.recording.start_ns) / 1e9

    def _traversal_name(self, traversal_id: int) -> str:
        return next(traversal.name for traversal in self.store.traversals() if traversal.id == traversal_id)

    def _stored_warnings(self, session: MappingSession) -> tuple[str, ...]:
        """What the recording, the backends and the session warn of, one line each; stored with the traversal."""
        perception = (self.backends.detector, self.backends.segmenter)
        of_perception = (line for each in perception if isinstance(each, WarningDetector) for line in each.warnings)
        stored = (*self.recording.warnings, *self.backends.odometry.warnings, *of_perception, *session.warnings)
        return (*stored, *self.empty_warnings)

    def _all_warnings(self, session: MappingSession) -> tuple[str, ...]:
        """The same, and what happened in this build."""
        return (*self._stored_warnings(session), *self.warnings)

    def collected_warnings(self) -> tuple[str, ...]:
        """What was warned of so far, for a build that ends early."""
        if self.session is None:
            return (*self.recording.warnings, *self.warnings)
        return self._all_warnings(self.session)

    def _summary(self, traversal_id: int, session: MappingSession, total_s: float) -> BuildSummary:
        labels = sorted(present_labels(session))
        session.statistics.labels = {label: labels.count(label) for label in labels}
        if session.placement is None:
            raise ValueError("a traversal that was mapped has its place")
        return BuildSummary(
            traversal_id,
            self._traversal_name(traversal_id),
            session.statistics,
            session.placement,
            self.clock.timings(),
            self.backends.names,
            self._recorded_s(),
            total_s,
            len(labels),
            self._all_warnings(session),
            self.shift_ns,
            None if self.resumed_ns is None else self._since_start_s(self.resumed_ns),
        )
