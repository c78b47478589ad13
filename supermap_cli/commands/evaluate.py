"""`supermap eval`: a map against ground truth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands import ablation, benchmark, perception
from supermap_cli.commands.common import JsonOption, err, out, print_json

if TYPE_CHECKING:
    from supermap_cli.evaluation.estimate import EstimatedMap
    from supermap_cli.evaluation.report import Report, Section
    from supermap_cli.types.truth import GroundTruth

EXAMPLES = """
Examples:

    supermap eval all office.db office/truth.json

    supermap eval map office.db office/truth.json --plot map.png

    supermap eval ablation office --seed 1
"""
EXAMPLE = "\nExample:\n\n    supermap eval {} office.db office/truth.json{}\n"

MAX_ALIGNMENT_RMSE_M = 0.5
"""Metres; above, the user is asked whether map and truth belong together. Chosen."""

Db = Annotated[str, typer.Argument(metavar="DB", help="The map database.")]
Truth = Annotated[Path, typer.Argument(metavar="TRUTH", help="The ground truth of its recordings: truth.json.")]
Plot = Annotated[Path | None, typer.Option(metavar="FILE", help="Also draw it, as .png, .svg or .pdf.")]


def register(app: typer.Typer) -> None:
    """Add the group to the app."""
    group = typer.Typer(no_args_is_help=True, help="Score a map against ground truth.", epilog=EXAMPLES)
    commands: tuple[tuple[Callable[..., None], str], ...] = (
        (score_map, " --plot map.png"),
        (score_change, " --plot change.png"),
        (score_identity, ""),
        (score_instances, ""),
        (score_semantics, ""),
        (score_query, ""),
        (score_all, " --json"),
    )
    for command, options in commands:
        name = command.__name__.removeprefix("score_")
        group.command(name, epilog=EXAMPLE.format(name, options))(command)
    group.command("ablation", epilog=ablation.EXAMPLES)(ablation.ablation)
    group.command("benchmark", epilog=benchmark.EXAMPLES)(benchmark.benchmark)
    group.command("perception", epilog=perception.EXAMPLES)(perception.perception)
    app.add_typer(group, name="eval")


def score_map(db: Db, truth: Truth, plot: Plot = None, json: JsonOption = False) -> None:
    """Objects at the map's end: precision, recall, F1, with and without the label."""
    _evaluate(db, truth, ("map",), plot=plot, as_json=json)


def score_change(db: Db, truth: Truth, plot: Plot = None, json: JsonOption = False) -> None:
    """What appeared, disappeared and moved: the paper's recalls, and precision and recall of what the diff reports."""
    _evaluate(db, truth, ("change",), plot=plot, as_json=json)


def score_identity(db: Db, truth: Truth, json: JsonOption = False) -> None:
    """Whether one thing is one instance, for life: instances per object, switches, IDF1, HOTA, relocated things."""
    _evaluate(db, truth, ("identity",), as_json=json)


def score_instances(db: Db, truth: Truth, json: JsonOption = False) -> None:
    """ScanNet's average precision of instances on points: AP, AP50, AP25."""
    _evaluate(db, truth, ("instances",), as_json=json)


def score_semantics(db: Db, truth: Truth, json: JsonOption = False) -> None:
    """Labels of points: mIoU, frequency-weighted mIoU and accuracy, with and without background."""
    _evaluate(db, truth, ("semantics",), as_json=json)


def score_query(
    db: Db,
    truth: Truth,
    questions: Annotated[
        Path | None,
        typer.Option(metavar="FILE.jsonl", help="Ask these, each with what is expected. [default: the truth's own]"),
    ] = None,
    json: JsonOption = False,
) -> None:
    """The share of the truth's questions that the map answers with exactly the right objects.

    Of a file of questions: by kind, how many answers are exact, right in part, refused, and wrong; and those that are
    not exact.
    """
    if questions is None:
        _evaluate(db, truth, ("query",), as_json=json)
        return
    from supermap_cli.commands.question_tables import print_matrix  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.evaluation.question_files import read_questions  # noqa: PLC0415
    from supermap_cli.evaluation.question_matrix import ask_map  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    matrix = ask_map(db, truth, read_questions(questions))
    if json:
        print_json(to_document(matrix))
    else:
        print_matrix(out(), matrix)


def score_all(db: Db, truth: Truth, plot: Plot = None, json: JsonOption = False) -> None:
    """All of these."""
    from supermap_cli.evaluation.report import SECTIONS  # noqa: PLC0415 - keeps start-up light

    _evaluate(db, truth, SECTIONS, plot=plot, as_json=json)


def _evaluate(
    db: str, truth_path: Path, sections: Sequence[Section], *, plot: Path | None = None, as_json: bool
) -> None:
    """Score and print, and draw if asked to; whether it can be drawn is checked before."""
    from supermap_cli.commands.eval_tables import print_report  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.evaluation.plots import check_picture  # noqa: PLC0415
    from supermap_cli.evaluation.reading import read_map  # noqa: PLC0415
    from supermap_cli.evaluation.report import score  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    if plot is not None:
        check_picture(plot)
    estimate, truth = read_map(db, truth_path)
    report = score(estimate, truth, sections)
    _warn_if_misaligned(report, truth_path)
    if as_json:
        print_json(to_document(report))
    else:
        print_report(out(), report)
    if plot is not None:
        _draw(plot, estimate, truth, sections)


def _warn_if_misaligned(report: Report, truth_path: Path) -> None:
    for traversal, rmse_m in report.alignment_rmse_m.items():
        if rmse_m > MAX_ALIGNMENT_RMSE_M:
            err().print(
                f"warning: the robot's way in {traversal} is {rmse_m:.1f} m off its true way: a lost odometry, "
                f"or is {truth_path} the truth of other recordings?",
                markup=False,
            )


def _draw(path: Path, estimate: EstimatedMap, truth: GroundTruth, sections: Sequence[Section]) -> None:
    from supermap_cli.evaluation.objects import score_objects  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.evaluation.plots import draw  # noqa: PLC0415

    panels = [section for section in ("map", "change") if section in sections]
    draw(path, estimate, truth, score_objects(estimate, truth), panel_names=panels)
    err().print(f"drawn: {path}", markup=False)
