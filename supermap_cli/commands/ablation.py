"""`supermap eval ablation`: the paper's ablation of its three components."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_args

import typer

from supermap_cli.commands.common import JsonOption, err, kept_or_temporary, out, print_json
from supermap_cli.commands.tables import print_table
from supermap_cli.commands.whole_numbers import whole
from supermap_cli.errors import EvaluationError

if TYPE_CHECKING:
    from supermap_cli.config import BuildConfig

EXAMPLES = """
Examples:

    supermap eval ablation office --seed 1

    supermap eval ablation office-twice --keep worlds/office-twice --json

    supermap eval ablation worlds/office-twice
"""


@dataclass(frozen=True)
class AblationRow:
    """One build. F1, precision and recall rest on `right`, `false` and `missed` objects; `change_recall` is per frame;
    `None` stands for what the world gives no occasion for.
    """

    switched_off: str | None
    right: int
    false: int
    missed: int
    f1: float | None
    precision: float | None
    recall: float | None
    ap50: float | None
    instances_per_object: float | None
    change_recall: float | None
    build_s: float


@dataclass(frozen=True)
class Ablation:
    """All builds of one world: as it is first, then without each component."""

    scenario: str
    seed: int
    rows: tuple[AblationRow, ...]


def ablation(
    world: Annotated[
        str, typer.Argument(metavar="SCENARIO|FOLDER", help="A scenario to simulate, or a folder with one, simulated.")
    ],
    seed: Annotated[
        int | None,
        typer.Option(min=0, callback=whole, help="Which world to simulate. [default: 1]", show_default=False),
    ] = None,
    keep: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Where to simulate and build, and leave both. [default: nowhere]")
    ] = None,
    json: JsonOption = False,
) -> None:
    """Build one world as it is, then with each of the three components switched off, and compare."""
    from supermap_cli.query.views import to_document  # noqa: PLC0415 - keeps start-up light

    if keep is not None:
        _check_is_new(keep)
    with kept_or_temporary(keep) as folder:
        result = compare(_simulated_world(world, seed, folder), folder)
    if json:
        print_json(to_document(result))
    else:
        _print(result)


def compare(world: Path, folder: Path) -> Ablation:
    """Build the world of a folder four times, each into a database of its own in another folder."""
    from supermap_cli.config import Ablation as Component  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.config import load_user_config  # noqa: PLC0415
    from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415

    truth = read_truth(world / TRUTH_FILE)
    recordings = [world / traversal.recording for traversal in truth.traversals]
    config = load_user_config(Path.cwd()).build
    rows = tuple(
        _row(component, recordings, config, world / TRUTH_FILE, folder / f"without-{component or 'nothing'}.db")
        for component in (None, *get_args(Component))
    )
    return Ablation(truth.scenario, truth.seed, rows)


def _row(component: str | None, recordings: list[Path], config: BuildConfig, truth_path: Path, db: Path) -> AblationRow:
    from supermap_cli.commands.build import Follow, build_all  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.commands.build_options import request  # noqa: PLC0415
    from supermap_cli.evaluation.change_recall import score_change_recall  # noqa: PLC0415
    from supermap_cli.evaluation.identity import score_identity  # noqa: PLC0415
    from supermap_cli.evaluation.instances import score_instances  # noqa: PLC0415
    from supermap_cli.evaluation.objects import score_objects  # noqa: PLC0415
    from supermap_cli.evaluation.reading import read_map  # noqa: PLC0415

    switched = config.model_copy(update={"ablate": (component,) if component else ()})
    began = time.perf_counter()
    for summary in build_all(recordings, switched, request(switched, None, None), str(db), Follow()):
        what = f"without {component}" if component else "as it is"
        err().print(f"built {summary.traversal} {what}: {summary.total_s:.0f} s", markup=False)
    build_s = time.perf_counter() - began
    estimate, truth = read_map(str(db), truth_path)
    objects = score_objects(estimate, truth).labelled
    return AblationRow(
        switched_off=component,
        right=objects.found,
        false=objects.false,
        missed=objects.missed,
        f1=objects.f1,
        precision=objects.precision,
        recall=objects.recall,
        ap50=score_instances(estimate, truth).ap50,
        instances_per_object=score_identity(estimate, truth).instances_per_object,
        change_recall=score_change_recall(estimate, truth).per_frame.change_recall,
        build_s=round(build_s, 1),
    )


def _check_is_new(keep: Path) -> None:
    """The folder to keep must hold no databases of an earlier run."""
    if old := sorted(keep.glob("without-*.db")):
        raise EvaluationError(
            "there are databases of an earlier comparison", where=str(old[0]), cure="name another folder with --keep"
        )
    keep.mkdir(parents=True, exist_ok=True)


def _simulated_world(world: str, seed: int | None, folder: Path) -> Path:
    """The folder of a simulated world: the one given, or one that is simulated now."""
    from supermap_cli.truth_file import TRUTH_FILE  # noqa: PLC0415 - keeps start-up light

    if (Path(world) / TRUTH_FILE).is_file():
        if seed is not None:
            raise EvaluationError(
                "here is a folder with a simulated world already, and a seed is for one to be simulated",
                where=world,
                cure="leave --seed out, or start from another folder",
            )
        return Path(world)
    from supermap_cli.commands.simulate import simulate_scenario  # noqa: PLC0415 - keeps start-up light

    simulate_scenario(world, folder, 1 if seed is None else seed, None, overwrite=False)
    return folder


def _print(result: Ablation) -> None:
    console = out()
    console.print(f"{result.scenario}, seed {result.seed}", markup=False)
    columns = (
        *("built", "right / false / missed#", "F1#", "precision#", "recall#", "AP50#"),
        *("instances per object#", "change recall#", "seconds#"),
    )
    print_table(console, "", columns, (_row_cells(row) for row in result.rows))
    console.print(
        "F1, precision, recall: objects at the end with the right label; AP50: ScanNet's, on points; instances per "
        "object: 1 is perfect; change recall: share of keyframes that are right about changed places. This is one "
        "world: a difference of an object or two may be chance until other seeds show it, too.",
        markup=False,
    )


def _row_cells(row: AblationRow) -> tuple[str, ...]:
    figures = (row.f1, row.precision, row.recall, row.ap50, row.instances_per_object, row.change_recall)
    name = f"without {row.switched_off}" if row.switched_off else "as it is"
    counts = f"{row.right} / {row.false} / {row.missed}"
    return (name, counts, *("-" if figure is None else f"{figure:.3f}" for figure in figures), f"{row.build_s:.0f}")
