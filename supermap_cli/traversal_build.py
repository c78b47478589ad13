"""One traversal is built: begun or gone on with, committed in batches, left complete, resumable, or not at all."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Literal

from supermap_cli.building.backends import choose_backends
from supermap_cli.building.checkpoints import Cadence, first_difference, is_resumable
from supermap_cli.building.known_stretches import check_no_stretch_is_known
from supermap_cli.building.placing import Placement, place_traversal
from supermap_cli.building.stopping import PoliteStop
from supermap_cli.building.tally import Tally
from supermap_cli.building.time_order import follow_in_time
from supermap_cli.config import BuildConfig
from supermap_cli.errors import BuildStoppedError, ConfigError, MemoryStoreError
from supermap_cli.memory.names import traversal_name
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import Checkpoint, StoredTraversal, TraversalStart
from supermap_cli.pipeline import FramePipeline, Progress
from supermap_cli.plugin_manager import Plugins
from supermap_cli.protocols import Recording
from supermap_cli.timing import StageClock, StageTiming
from supermap_cli.types.memory import MapDelta
from supermap_cli.version import __version__

Unfinished = Literal["refuse", "resume", "restart"]
"""What becomes of a build that was stopped before."""

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


@dataclass(frozen=True)
class GoingOn:
    """A build that was stopped, and what it goes on from."""

    traversal: StoredTraversal
    checkpoint: Checkpoint


class TraversalBuild:
    """Builds one traversal into the memory."""

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
        self.config = config
        self.store = store
        self.clock = StageClock() if clock is None else clock
        self.backends = choose_backends(recording, plugins, config)
        self.stages = FramePipeline(recording, self.backends, plugins, config, self.clock, look_ahead=look_ahead)
        self.viewers = [each for each in plugins.working if "keyframe_mapped" in each.hooks]
        self.cadence = Cadence(config.keyframes.checkpoint_s)
        self.wish = "auto"
        self.warnings: list[str] = []
        self.spent_s: dict[str, float] = {}
        self.committed_ns = 0
        self.kept_s: float | None = None
        self._worth_keeping = True

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
        self.wish = align
        stopped = self._stopped_build(unfinished, name)
        going_on = None if stopped is None else self._checkpoint_of(stopped, unfinished)
        replaced = None if stopped is None or going_on is not None else stopped.id
        again = again or (stopped is not None and stopped.fingerprint == self.recording.fingerprint())
        if going_on is None:
            self._check_it_can_follow(name, replaced, again=again)
        traversal_id: int | None = None
        try:
            if going_on is None:
                placement = self._place(replaced)
                self._take_out(replaced)
                traversal_id = self._begin(placement, name, again=again)
                self.stages.restore(self.store, placement)
            else:
                traversal_id = going_on.traversal.id
                placement = self._resume(going_on)
            with PoliteStop() as stop:
                self._map_all(traversal_id, placement, stop, progress)
            total_s = self._finish(traversal_id)
        except BaseException:  # Ctrl-C too: whatever stops the build goes on upwards
            self._leave_to_be_resumed(traversal_id)
            raise
        return self._summary(traversal_id, placement, total_s)

    def _map_all(self, traversal_id: int, placement: Placement, stop: PoliteStop, progress: Progress | None) -> None:
        """Every keyframe, committed in batches."""
        with closing(self.stages.batches(placement, progress)) as batches:
            for batch in batches:
                if self._was_committed(batch):
                    continue
                stopping = stop.requested
                checkpoint = self._checkpoint(placement, wanted=stopping)
                with self.clock.stage("write"):
                    self.store.commit(traversal_id, batch, checkpoint)
                self._tell_viewers(batch)
                if stopping:
                    raise BuildStoppedError(
                        f"stopped at {self._mapped_s():.1f} s of {self._recorded_s():.1f} s",
                        where=str(self.recording.path),
                        cure="its tracker has no checkpoints, so nothing of it is kept"
                        if checkpoint is None
                        else "what is mapped so far is kept: go on with --resume, or begin anew with --restart",
                    )

    def _checkpoint(self, placement: Placement, *, wanted: bool) -> Checkpoint | None:
        """What the build could go on from after this batch, if it is time for that, or wanted."""
        if not (wanted or self.cadence.due()) or not is_resumable(self.backends.tracker):
            return None
        began = time.monotonic()
        checkpoint = self.stages.checkpoint(placement, self._spent_s())
        self.cadence.written(began)
        return checkpoint

    def _was_committed(self, batch: MapDelta) -> bool:
        """Whether a former run of this build had written this batch already. The last one, that holds no keyframes, may
        be written twice: it only says what things are like at the end.
        """
        return bool(batch.keyframes) and batch.keyframes[-1].stamp_ns <= self.committed_ns

    def _finish(self, traversal_id: int) -> float:
        """The traversal is in the map for good. Returns the seconds that this took, in all."""
        self._worth_keeping = False
        self.stages.tally.check_something_came_of_it(str(self.recording.path), self.backends.names["detector"])
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
                self.kept_s = self._mapped_s() if self.stages.newest_ns else None
                return
            if traversal_id is not None:
                self.store.discard_traversal(traversal_id)
            self.store.discard_if_created()

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

    def _stopped_build(self, unfinished: Unfinished, name: str | None) -> StoredTraversal | None:
        """Before any work: a build that was stopped before, and is to go on or to be replaced by this one."""
        stopped, fingerprint = self.store.unfinished(), self.recording.fingerprint()
        if stopped is None or unfinished == "restart":
            return stopped
        if unfinished == "refuse" or stopped.fingerprint != fingerprint:
            what, cure = _in_the_way(stopped, fingerprint)
            raise MemoryStoreError(what, where=str(self.recording.path), cure=cure)
        self._check_it_is_built_alike(stopped, name)
        return stopped

    def _check_it_is_built_alike(self, stopped: StoredTraversal, name: str | None) -> None:
        now = {"build": self._config(), "versions": _VERSIONS, "name": name or stopped.name}
        begun_with = {entry: value for entry, value in stopped.config.items() if entry != "placed"}
        before = {"build": begun_with, "versions": dict(stopped.versions), "name": stopped.name}
        difference = first_difference(before, now)
        if difference is not None:
            raise ConfigError(
                f"the build of {stopped.name!r} was begun otherwise: {difference}",
                where=str(self.recording.path),
                cure="go on with the settings it was begun with, or begin anew with --restart",
            )

    def _checkpoint_of(self, stopped: StoredTraversal, unfinished: Unfinished) -> GoingOn | None:
        """What a stopped build goes on from; `None` where it is to begin anew, or has no checkpoint."""
        if unfinished == "restart" or not is_resumable(self.backends.tracker):
            return None
        checkpoint = self.store.checkpoint(stopped.id)
        return None if checkpoint is None else GoingOn(stopped, checkpoint)

    def _check_it_can_follow(self, name: str | None, replaced: int | None, *, again: bool) -> None:
        """Before any work: a recording enters once, and the map's time goes forward."""
        where = str(self.recording.path)
        self.store.check_is_new(where, self.recording.fingerprint(), name, again=again, without=replaced)
        earlier = [each for each in self.store.traversals() if each.id != replaced]
        if not again:
            check_no_stretch_is_known(self.recording, earlier)
        self._go_on_in_time(name, earlier)

    def _take_out(self, replaced: int | None) -> None:
        """What a stopped build wrote goes, now that nothing stands in the way of the one that replaces it."""
        if replaced is not None:
            for stopped in self.store.roll_back_unfinished():
                self.warnings.append(f"the build of {stopped!r} had been stopped: what it had written was taken out")

    def _go_on_in_time(self, name: str | None, earlier: Sequence[StoredTraversal]) -> None:
        """The map's time goes forward, whatever the recording's clock says."""
        name = name or traversal_name(str(self.recording.path), {each.name for each in earlier})
        shift = follow_in_time(self.recording, name, earlier)
        self.stages.go_on_in_time(shift.shift_ns)
        if shift.warning is not None:
            self.warnings.append(shift.warning)

    def _place(self, replaced: int | None) -> Placement:
        with self.clock.stage("place"):
            return place_traversal(self.recording, self.backends.trajectory, self.store, self.wish, without=replaced)

    def _config(self) -> dict[str, object]:
        """All settings that the map depends on, as they are stored."""
        return {**self.config.model_dump(mode="json"), "used": self.backends.names, "align": self.wish}

    def _begin(self, placement: Placement, name: str | None, *, again: bool) -> int:
        start = TraversalStart(
            recording=str(self.recording.path),
            fingerprint=self.recording.fingerprint(),
            start_ns=self.recording.start_ns + self.stages.shift_ns,
            end_ns=self.recording.end_ns + self.stages.shift_ns,
            T_map_odom=placement.T_map_odom,
            config={**self._config(), "placed": placement.method},
            versions=_VERSIONS,
            name=name,
            clock_shift_ns=self.stages.shift_ns,
        )
        return self.store.begin_traversal(start, again=again)

    def _resume(self, going_on: GoingOn) -> Placement:
        state = self.stages.resume(self.store, going_on.traversal, going_on.checkpoint)
        self.spent_s = state.spent_s
        self.committed_ns = going_on.traversal.mapped_ns or going_on.checkpoint.stamp_ns
        return state.placement

    # -- after the last frame

    def _spent_s(self) -> dict[str, float]:
        """Seconds by stage, those of former runs of this build included."""
        now_s = {each.stage: each.total_s for each in self.clock.timings()}
        spent_s = {stage: self.spent_s.get(stage, 0.0) + now_s.get(stage, 0.0) for stage in {**self.spent_s, **now_s}}
        return {**spent_s, "total": self.spent_s.get("total", 0.0) + time.perf_counter() - self.began}

    def _mapped_s(self) -> float:
        return max(0.0, self._since_start_s(self.stages.newest_ns))

    def _since_start_s(self, stamp_ns: int) -> float:
        """Seconds from the recording's start to a time of the map."""
        return (stamp_ns - self.stages.shift_ns - self.recording.start_ns) / 1e9

    def _recorded_s(self) -> float:
        return (self.recording.end_ns - self.recording.start_ns) / 1e9

    def _summary(self, traversal_id: int, placement: Placement, total_s: float) -> BuildSummary:
        standing = [each for each in self.stages.engine.objects if each.confirmed and each.present and not each.demoted]
        for each in sorted(standing, key=lambda o: o.label):
            self.stages.tally.labels[each.label] = self.stages.tally.labels.get(each.label, 0) + 1
        name = next(each.name for each in self.store.traversals() if each.id == traversal_id)
        warnings = [*self.recording.warnings, *placement.warnings, *self.warnings]
        if self.stages.tally.without_pose:
            warnings.append(f"{self.stages.tally.without_pose} images had no pose and were left out")
        if self.stages.late.too_late:
            wait_s = self.config.perception.wait_s
            warnings.append(
                f"the detections of {self.stages.late.too_late} images came over {wait_s:g} s late and were left out "
                "(build.perception.wait_s)"
            )
        return BuildSummary(
            traversal_id,
            name,
            self.stages.tally,
            placement,
            self.clock.timings(),
            self.backends.names,
            self._recorded_s(),
            total_s,
            len(standing),
            tuple(warnings),
            self.stages.shift_ns,
            None if self.stages.resumed_ns is None else self._since_start_s(self.stages.resumed_ns),
        )


def _in_the_way(stopped: StoredTraversal, fingerprint: str) -> tuple[str, str]:
    """What to say of a stopped build that is neither to go on nor to be taken out, and the cure."""
    done = 0.0 if stopped.mapped_ns is None else (stopped.mapped_ns - stopped.start_ns)
    share = f"{100 * done / max(stopped.end_ns - stopped.start_ns, 1):.0f} %"
    if stopped.fingerprint == fingerprint:
        return f"its build was stopped at {share}", "go on with --resume, or begin anew with --restart"
    end_it = f"let it end first, with the options it was begun with (supermap build {stopped.recording} --resume)"
    return f"the build of {stopped.name!r} was stopped at {share}", f"{end_it}, or take out what it wrote (--restart)"
