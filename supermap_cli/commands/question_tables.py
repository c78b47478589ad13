"""The answers to a file of questions as tables: by kind and by language, then those that are not exact."""

from __future__ import annotations

from typing import TYPE_CHECKING

from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from rich.console import Console

    from supermap_cli.evaluation.question_matrix import KindRow, QuestionMatrix

_TITLES = {
    "wrong": "wrong",
    "partly": "right in part",
    "refused": "refused, or with another reason than expected",
}


def print_matrix(console: Console, matrix: QuestionMatrix) -> None:
    """All tables of a matrix."""
    for title, first, rows in (
        ("Questions by kind", "kind", (*matrix.kinds, matrix.all)),
        ("Questions by language", "language", matrix.languages),
    ):
        columns = (first, "asked#", "exact#", "partly#", "refused#", "WRONG#")
        print_table(console, title, columns, (_cells(row) for row in rows))
    for verdict, title in _TITLES.items():
        found = [each for each in matrix.not_exact if each.verdict == verdict]
        if found:
            cells = ((each.text, each.kind, each.expected, each.answered) for each in found)
            print_table(console, title, ("question", "kind", "expected", "answered"), cells)
    if matrix.exact_share is not None and matrix.wrong_share is not None:
        console.print(f"exact {matrix.exact_share:.3f}, wrong {matrix.wrong_share:.3f}", markup=False)
    left_out = len(matrix.left_out)
    if left_out:
        console.print(f"{left_out} left out: the images, or the number of traversals, leave their answers open")


def _cells(row: KindRow) -> tuple[str, ...]:
    return row.name, *(str(count) for count in (row.asked, row.exact, row.partly, row.refused, row.wrong))
