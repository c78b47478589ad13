"""The measurements, each run in a process of its own."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator

from supermap_cli.allocation import keep_freed_memory
from supermap_cli.costs.job import BuildRun, CostJob, DecodeRun, Run, StagesRun
from supermap_cli.costs.map_growth import fill_map
from supermap_cli.costs.peak_memory import peak_memory_mb
from supermap_cli.drivers.backends import choose_backends
from supermap_cli.drivers.build_summary import BuildSummary
from supermap_cli.drivers.keyframe_choice import choose_frames
from supermap_cli.drivers.traversal_build import TraversalBuild
from supermap_cli.hookspecs import RecordingRequest
from supermap_cli.memory.opening import open_store
from supermap_cli.memory.store import MapStore
from supermap_cli.plugin_manager import Plugins, load_plugins
from supermap_cli.protocols import Recording
from supermap_cli.recordings import open_bag_recording
from supermap_cli.timing import StageClock


def measure(job: CostJob) -> Run:
    """Run a job. Raises a `SupermapError` for recordings that cannot be mapped."""
    keep_freed_memory()
    plugins = load_plugins()
    if job.measurement == "decode":
        return decode(job, plugins)
    if job.measurement == "build":
        return build(job, plugins)
    with open_store(str(job.db), create=True) as store:
        if job.measurement == "stages":
            return stages(job, plugins, store)
        return growth(job, plugins, store)


def build(job: CostJob, plugins: Plugins) -> BuildRun:
    """Build all recordings as `supermap build` does."""
    began = time.perf_counter()
    with open_store(str(job.db), create=True) as store:
        summaries = [
            TraversalBuild(recording, plugins, job.config, store).run(align=job.align)
            for recording in _open_recordings(job, plugins, job.request)
        ]
    total_s = time.perf_counter() - began
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return BuildRun(
        keyframes=sum(summary.statistics.keyframes for summary in summaries),
        detections=sum(summary.statistics.detections for summary in summaries),
        objects=summaries[-1].instances,
        recorded_s=sum(summary.recorded_s for summary in summaries),
        total_s=total_s,
        cpu_s=usage.ru_utime + usage.ru_stime,
        peak_memory_mb=peak_memory_mb(),
        database_mb=job.db.stat().st_size / 1e6,
        backends=summaries[-1].backends,
    )


def stages(job: CostJob, plugins: Plugins, store: MapStore) -> StagesRun:
    """Build all recordings, one stage at a time."""
    clock = StageClock()
    summaries = [
        TraversalBuild(recording, plugins, job.config, store, clock=clock, look_ahead=False).run(align=job.align)
        for recording in _open_recordings(job, plugins, job.request)
    ]
    return _stages_run(summaries, clock)


def growth(job: CostJob, plugins: Plugins, store: MapStore) -> StagesRun:
    """Map the second half of the first recording into a map of `job.objects` objects."""
    recording = next(_open_recordings(job, plugins, job.request))
    start_s = job.request.start_s or 0.0
    middle_s = start_s + (recording.end_ns - recording.start_ns) / 2e9
    first, second = (job.request.model_copy(update=half) for half in ({"end_s": middle_s}, {"start_s": middle_s}))
    built = TraversalBuild(next(_open_recordings(job, plugins, first)), plugins, job.config, store).run(align=job.align)
    fill_map(store, built.traversal_id, job.objects, job.config.mapping.max_depth_m)
    clock = StageClock()
    traversal = TraversalBuild(
        next(_open_recordings(job, plugins, second)), plugins, job.config, store, clock=clock, look_ahead=False
    )
    return _stages_run([traversal.run(align=job.align)], clock)


def decode(job: CostJob, plugins: Plugins) -> DecodeRun:
    """Decode the keyframes that a build would map, and what was recorded for them, and drop all of it."""
    keyframes, total_s = 0, 0.0
    for recording in _open_recordings(job, plugins, job.request):
        detector = choose_backends(recording, plugins, job.config).detector
        chosen = choose_frames(recording, detector, job.config)
        for camera_id, due in chosen.items():
            next(recording.frames({min(due.mapped, default=0)}.__contains__, camera_id), None)  # calibrates the camera
        began = time.perf_counter()
        for camera_id, due in chosen.items():
            recorded = detector.image_stamps_ns(camera_id) is not None
            for frame in recording.frames(due.mapped.__contains__, camera_id):
                keyframes += 1
                if recorded and frame.stamp_ns in due.perceived:
                    detector.detect(frame)
        total_s += time.perf_counter() - began
    return DecodeRun(keyframes, total_s, peak_memory_mb())


def _stages_run(summaries: list[BuildSummary], clock: StageClock) -> StagesRun:
    keyframes = sum(summary.statistics.keyframes for summary in summaries)
    return StagesRun(keyframes, summaries[-1].instances, clock.timings())


def _open_recordings(job: CostJob, plugins: Plugins, request: RecordingRequest) -> Iterator[Recording]:
    for path in job.recordings:
        opened = plugins.open_recording(path, request)
        yield opened if opened is not None else open_bag_recording(path, request)
