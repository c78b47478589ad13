"""`supermap eval benchmark --suite domains`: how right the map is as one axis at a time is varied."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from supermap_cli.commands.common import err, kept_or_temporary, out, print_json
from supermap_cli.commands.tables import print_table
from supermap_cli.errors import EvaluationError
from supermap_cli.output_files import check_output
from supermap_cli.simulation.domains.axes import AXES, RANDOM
from supermap_cli.simulation.domains.suite import USUAL, SuiteWorld, suite_worlds

if TYPE_CHECKING:
    from supermap_cli.evaluation.calibration import Rated, Reliability

FIGURES: Mapping[str, str] = {
    "f1": "objects: F1",
    "precision": "objects: precision",
    "recall": "objects: recall",
    "f1_unlabelled": "objects: F1 without label",
    "ap50": "instances: AP50",
    "switches": "identity: switches of static objects",
    "ids_kept": "identity: relocated, same id",
    "change_precision": "change: precision of the diff",
    "change_recall": "change: recall of the diff",
    "claimed": "change: claimed where nothing changes",
}
"""Figure of the suite -> the line of the benchmark's table that it is."""

SCENARIO = "room"
"""The scenario whose world the axes may vary."""
WORST_SHOWN = 10
SCORES_NAME = "suite_scores.json"
"""Where in its folder a world's scores are kept, as soon as there are any."""
WORLD_LIMIT_S = 1800
"""The longest that one world may take to simulate, build and score, s: thirty times what the usual one does."""


@dataclass(frozen=True)
class WorldScores:
    """One world's figures by name; `None` where it gave no occasion. `failed` says why there are none at all. `rated`
    are the confidences of the map's instances, and whether they are right.
    """

    axis: str
    level: str
    seed: int
    half: str
    figures: dict[str, float | None]
    failed: str | None
    rated: tuple[Rated, ...] = ()


@dataclass(frozen=True)
class LevelScores:
    """Means over the worlds of one level; a world that failed counts with an F1 of 0."""

    axis: str
    level: str
    worlds: int
    failed: int
    figures: dict[str, float | None]


@dataclass(frozen=True)
class DomainSuite:
    """The whole table: `overall` over all worlds, `levels` in the order of the axes, `worlds` one by one, and the
    reliability of the confidences of all their maps together.
    """

    overall: LevelScores
    levels: tuple[LevelScores, ...]
    worlds: tuple[WorldScores, ...]
    calibration: Reliability


def run_suite(
    half: str | None, axes: Sequence[str], jobs: int, keep: Path | None, *, resume: bool = False, json: bool
) -> None:
    """Build and score the suite's worlds (of one half, of some axes), `jobs` at a time, and print the table; `resume`
    takes the scores that lie in `keep` already.

    Raises `EvaluationError` for an unknown axis.
    """
    from supermap_cli.query.views import to_document  # noqa: PLC0415 - keeps start-up light

    known = (USUAL, *AXES, RANDOM)
    if unknown := [axis for axis in axes if axis not in known]:
        raise EvaluationError(f"there is no axis {unknown[0]!r}", cure=f"choose one of {', '.join(known)}")
    worlds = [
        world for world in suite_worlds() if (half is None or world.half == half) and (not axes or world.axis in axes)
    ]
    with kept_or_temporary(keep) as folder:
        suite = summarise(_score_all(worlds, jobs, folder, resume=resume))
    if json:
        print_json(to_document(suite))
    else:
        _print(suite)


def summarise(worlds: Sequence[WorldScores]) -> DomainSuite:
    """The means by level, in the order of the worlds, and over all."""
    by_level: dict[tuple[str, str], list[WorldScores]] = {}
    for world in worlds:
        by_level.setdefault((world.axis, world.level), []).append(world)
    levels = tuple(_mean(axis, level, group) for (axis, level), group in by_level.items())
    from supermap_cli.evaluation.calibration import reliability  # noqa: PLC0415 - keeps start-up light

    rated = [pair for world in worlds for pair in world.rated]
    return DomainSuite(_mean("all", "", worlds), levels, tuple(worlds), reliability(rated))


def _mean(axis: str, level: str, worlds: Sequence[WorldScores]) -> LevelScores:
    figures: dict[str, float | None] = {}
    for name in FIGURES:
        values = [0.0 if world.failed is not None and name == "f1" else world.figures.get(name) for world in worlds]
        defined = [value for value in values if value is not None]
        figures[name] = round(sum(defined) / len(defined), 4) if defined else None
    return LevelScores(axis, level, len(worlds), sum(world.failed is not None for world in worlds), figures)


def _score_all(worlds: Sequence[SuiteWorld], jobs: int, folder: Path, *, resume: bool) -> list[WorldScores]:
    """All worlds in their order, each in a process of its own, or as it was scored before."""
    console = err()
    scored: dict[SuiteWorld, WorldScores] = {}
    with ThreadPoolExecutor(jobs) as pool:
        waiting = {pool.submit(_score_or_take, world, folder, resume=resume): world for world in worlds}
        try:
            for number, done in enumerate(as_completed(waiting), start=1):
                world, result = waiting[done], done.result()
                scored[world] = result
                f1 = result.figures.get("f1")
                told = result.failed or ("no F1" if f1 is None else f"F1 {f1:.3f}")
                console.print(f"{number}/{len(worlds)}  {world.name}: {told}", markup=False)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise
    return [scored[world] for world in worlds]


def _score_or_take(world: SuiteWorld, folder: Path, *, resume: bool) -> WorldScores:
    """The scores of one world, which are kept in its folder; with `resume`, those that are kept there already.

    A world that failed has none: it is built again.
    """
    from supermap_cli.query.views import to_document  # noqa: PLC0415 - keeps start-up light

    place = folder / f"{world.axis}={world.level}" if world.level else folder / world.axis
    kept = place / SCENARIO / str(world.seed) / SCORES_NAME
    if resume and (known := read_scores(kept, world)) is not None:
        return known
    check_output(kept, "scores", option="--keep")
    kept.unlink(missing_ok=True)
    scores = _score(world, place)
    if scores.failed is None:
        kept.parent.mkdir(parents=True, exist_ok=True)
        unfinished = kept.with_suffix(".part")
        unfinished.write_text(json.dumps(to_document(scores), indent=2, allow_nan=False), encoding="utf-8")
        unfinished.replace(kept)
    return scores


def read_scores(path: Path, world: SuiteWorld) -> WorldScores | None:
    """The kept scores of a world; `None` where there are none.

    Raises `EvaluationError` where the file holds something else.
    """
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        there = WorldScores(
            kept["axis"],
            kept["level"],
            kept["seed"],
            kept["half"],
            {name: kept["figures"][name] for name in FIGURES},
            None,
            _pairs(kept["rated"]),
        )
    except FileNotFoundError:
        return None
    except (ValueError, LookupError, TypeError) as error:
        raise EvaluationError(
            f"these are no scores of a world: {error!r}", where=str(path), cure="remove it, or leave out --resume"
        ) from error
    if (there.axis, there.level, there.seed, there.half) != (world.axis, world.level, world.seed, world.half):
        raise EvaluationError(
            f"these are the scores of another world than {world.name}", where=str(path), cure="remove it"
        )
    return there


def _pairs(rated: Any) -> tuple[Rated, ...]:
    return tuple((float(confidence), bool(right)) for confidence, right in rated)


def _score(world: SuiteWorld, place: Path) -> WorldScores:
    """Run the benchmark of one world in a child process, which keeps the world in a folder."""
    command = [sys.executable, "-c", "import sys; from supermap_cli.main import main; sys.exit(main())"]
    command += ["eval", "benchmark", SCENARIO, "--seeds", str(world.seed), "--keep", str(place), "--json"]
    command += [argument for level in world.domain for argument in ("--domain", level)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NO_COLOR": "1"}
    try:
        child = subprocess.run(  # noqa: S603 - our own program
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
            timeout=WORLD_LIMIT_S,
            env=environment,
        )
    except subprocess.TimeoutExpired:
        return WorldScores(world.axis, world.level, world.seed, world.half, {}, f"longer than {WORLD_LIMIT_S} s")
    if child.returncode != 0:
        last = child.stderr.strip().splitlines()[-1:] or [f"exit {child.returncode}"]
        return WorldScores(world.axis, world.level, world.seed, world.half, {}, last[0])
    document = json.loads(child.stdout)
    rated = _pairs(document["tables"][0]["rated"][0])
    return WorldScores(world.axis, world.level, world.seed, world.half, figures_of(document), None, rated)


def figures_of(document: Mapping[str, Any]) -> dict[str, float | None]:
    """The suite's figures of a benchmark with one world."""
    means = {figure["name"]: figure["mean"] for figure in document["tables"][0]["figures"]}
    return {name: means.get(line) for name, line in FIGURES.items()}


def _print(suite: DomainSuite) -> None:
    from supermap_cli.commands.eval_tables import print_reliability  # noqa: PLC0415 - keeps start-up light

    console = out()
    columns = ("axis", "level", "worlds#", *(f"{_heading(name)}#" for name in FIGURES))
    rows = [*suite.levels, suite.overall]
    print_table(console, "Means by level", columns, map(_cells, rows))
    print_table(
        console, f"The worst {WORST_SHOWN} worlds", ("world", "F1#", "P#", "R#", "failed"), _worst(suite.worlds)
    )
    print_reliability(console, suite.calibration)


def _heading(name: str) -> str:
    short = {"f1": "F1", "precision": "P", "recall": "R", "f1_unlabelled": "F1 any label", "ap50": "AP50"}
    return short.get(name, name.replace("_", " "))


def _cells(level: LevelScores) -> tuple[str, ...]:
    worlds = f"{level.worlds} ({level.failed} failed)" if level.failed else str(level.worlds)
    return (level.axis, level.level, worlds, *(_cell(level.figures[name]) for name in FIGURES))


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _worst(worlds: Sequence[WorldScores]) -> Iterator[tuple[str, ...]]:
    """The worlds of the lowest F1, the failed ones first."""
    ordered = sorted(worlds, key=lambda world: -1.0 if world.failed is not None else world.figures.get("f1") or 0.0)
    for world in ordered[:WORST_SHOWN]:
        name = f"{world.axis}={world.level}, seed {world.seed}" if world.level else f"{world.axis}, seed {world.seed}"
        f1, precision, recall = (_cell(world.figures.get(figure)) for figure in ("f1", "precision", "recall"))
        yield name, f1, precision, recall, world.failed or ""
