"""The figures of `supermap bench`: the document it prints with --json."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter, ValidationError

from supermap_cli.costs.job import BuildRun, DecodeRun, StagesRun
from supermap_cli.errors import EvaluationError
from supermap_cli.input_files import read_text
from supermap_cli.timing import StageTiming
from supermap_cli.version import __version__

StageKind = Literal["once", "perception", "mapping"]

ONE_TIME_STAGES = ("place", "restore")
"""Stages that run once a traversal, not for every keyframe."""
MAPPING_STAGES = ("segment", "visibility", "track", "map", "graph", "record", "write")
"""All stages of a keyframe but decoding, odometry and neural inference."""

PAPER_HZ = {"pose": 10.0, "map": 3.0, "segmentation": 1.0, "graph": 5.0}
"""Module -> updates a second on the robot, as the paper SuperMap states them."""
STAGES_OF_MODULE = {
    "pose": ("odometry", "depth", "drift"),
    "map": ("visibility", "track", "map", "record", "write"),
    "segmentation": ("detect", "segment"),
    "graph": ("graph",),
}
"""Module of the paper -> the stages that do its work here."""


@dataclass(frozen=True)
class StageCost:
    """One stage: `mean_ms` and `p95_ms` of its runs, `share` of all stages' time."""

    stage: str
    kind: StageKind
    runs: int
    total_s: float
    mean_ms: float
    p95_ms: float
    share: float


@dataclass(frozen=True)
class ModuleRate:
    """Updates a second of a module with a core to itself, beside the paper's; `ms` is its time for a keyframe."""

    module: str
    stages: tuple[str, ...]
    ms: float
    hz: float
    paper_hz: float


@dataclass(frozen=True)
class BuildCost:
    """The build as `supermap build` does it, perception beside mapping: sizes in 10^6 bytes.

    `realtime_factor`: seconds of recording mapped in a second; `cores`: CPU seconds for a second of recording.
    """

    recorded_s: float
    total_s: float
    realtime_factor: float
    cpu_s: float
    cores: float
    peak_memory_mb: float
    database_mb: float


@dataclass(frozen=True)
class DecodingBaseline:
    """Cost of decoding the same keyframes and recorded detections; `ratio` is mapping in units of it.

    Milliseconds for a keyframe. `decode_ms` was measured in a process that did nothing else.
    """

    decode_ms: float
    mapping_ms: float
    ratio: float
    peak_memory_mb: float


@dataclass(frozen=True)
class MappingGrowth:
    """Mapping time for a keyframe with at least `wanted` objects in the map; `objects` is the count at the end."""

    wanted: int
    objects: int
    keyframes: int
    mapping_ms: float


@dataclass(frozen=True)
class FigureChange:
    """A figure of both documents; `ratio` is then / now."""

    figure: str
    then: float
    now: float
    ratio: float | None


@dataclass(frozen=True)
class BenchComparison:
    """All figures compared with an earlier document."""

    document: str
    changes: tuple[FigureChange, ...]


@dataclass(frozen=True)
class Machine:
    """Cores, operating system and versions of a measurement."""

    cpus: int
    system: str
    python: str
    supermap: str


@dataclass(frozen=True)
class Bench:
    """All figures of one measurement."""

    recordings: tuple[str, ...]
    machine: Machine
    backends: dict[str, str]
    keyframes: int
    detections: int
    objects: int
    build: BuildCost
    stages: tuple[StageCost, ...]
    rates: tuple[ModuleRate, ...]
    floor: DecodingBaseline
    growth: tuple[MappingGrowth, ...] = ()
    compared: BenchComparison | None = None


def summarise(
    recordings: Sequence[Path],
    build: BuildRun,
    stages: StagesRun,
    decode: DecodeRun,
    growth: Sequence[tuple[int, StagesRun]],
) -> Bench:
    """The document made of the results of all measurements."""
    return Bench(
        recordings=tuple(map(str, recordings)),
        machine=this_machine(),
        backends=build.backends,
        keyframes=build.keyframes,
        detections=build.detections,
        objects=build.objects,
        build=_build_cost(build),
        stages=tuple(_stage_costs(stages.timings)),
        rates=tuple(_module_rates(stages)),
        floor=_decoding_baseline(stages, decode),
        growth=tuple(
            MappingGrowth(wanted, stages_run.objects, stages_run.keyframes, mapping_ms(stages_run))
            for wanted, stages_run in growth
        ),
    )


def this_machine() -> Machine:
    """The machine this process runs on; only cores that it may use are counted."""
    cpus = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return Machine(cpus, f"{platform.system()} {platform.machine()}", platform.python_version(), __version__)


def mapping_ms(stages: StagesRun) -> float:
    """Milliseconds of all mapping stages for a keyframe."""
    return _per_keyframe_ms(stages, MAPPING_STAGES)


def _per_keyframe_ms(stages: StagesRun, names: Sequence[str]) -> float:
    return 1000 * sum(timing.total_s for timing in stages.timings if timing.stage in names) / max(stages.keyframes, 1)


def _build_cost(build: BuildRun) -> BuildCost:
    return BuildCost(
        recorded_s=build.recorded_s,
        total_s=build.total_s,
        realtime_factor=build.recorded_s / max(build.total_s, 1e-9),
        cpu_s=build.cpu_s,
        cores=build.cpu_s / max(build.recorded_s, 1e-9),
        peak_memory_mb=build.peak_memory_mb,
        database_mb=build.database_mb,
    )


def _stage_costs(timings: Sequence[StageTiming]) -> Iterator[StageCost]:
    everything_s = sum(timing.total_s for timing in timings)
    for timing in timings:
        kind: StageKind = (
            "once" if timing.stage in ONE_TIME_STAGES else "mapping" if timing.stage in MAPPING_STAGES else "perception"
        )
        share = timing.total_s / max(everything_s, 1e-9)
        yield StageCost(timing.stage, kind, timing.runs, timing.total_s, timing.mean_ms, timing.p95_ms, share)


def _module_rates(stages: StagesRun) -> Iterator[ModuleRate]:
    ran = {timing.stage for timing in stages.timings}
    for module, names in STAGES_OF_MODULE.items():
        ms = _per_keyframe_ms(stages, names)
        if ms > 0:
            present = tuple(name for name in names if name in ran)
            yield ModuleRate(module, present, ms, 1000 / ms, PAPER_HZ[module])


def _decoding_baseline(stages: StagesRun, decode: DecodeRun) -> DecodingBaseline:
    decode_ms = 1000 * decode.total_s / max(decode.keyframes, 1)
    mapping = mapping_ms(stages)
    return DecodingBaseline(decode_ms, mapping, mapping / max(decode_ms, 1e-9), decode.peak_memory_mb)


def compare(now: Bench, then: Bench, document: Path) -> BenchComparison:
    """Compare every figure that both documents have."""
    before = dict(_figures(then))
    changes = [
        FigureChange(name, before[name], value, before[name] / value if value > 0 else None)
        for name, value in _figures(now)
        if name in before
    ]
    return BenchComparison(str(document), tuple(changes))


def _figures(bench: Bench) -> Iterator[tuple[str, float]]:
    for stage in bench.stages:
        yield f"{stage.stage}, mean ms", stage.mean_ms
    yield "mapping, ms a keyframe", bench.floor.mapping_ms
    yield "decoding alone, ms a keyframe", bench.floor.decode_ms
    yield "mapping / decoding alone", bench.floor.ratio
    for step in bench.growth:
        yield f"mapping with {step.wanted} objects, ms a keyframe", step.mapping_ms
    yield "build, s for a second of recording", bench.build.total_s / max(bench.build.recorded_s, 1e-9)
    yield "cores in use at realtime", bench.build.cores
    yield "peak memory, MB", bench.build.peak_memory_mb
    yield "database, MB", bench.build.database_mb


def read_bench(path: Path) -> Bench:
    """An earlier document. Raises `EvaluationError` for a file that is none."""
    text = read_text(path, EvaluationError, what="a document of `supermap bench --json`")
    try:
        return TypeAdapter(Bench).validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        entry = ".".join(str(part) for part in first["loc"])
        raise EvaluationError(
            f"this is no document of `supermap bench --json`: {entry + ': ' if entry else ''}{first['msg']}",
            where=str(path),
            cure="make one with `supermap bench RECORDING --json > old.json`",
        ) from error
