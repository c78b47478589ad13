"""The table of the zoo in docs/recordings.md: what is read, with which options, and what is refused.

PYTHONPATH=tests python -m zoo.documentation        # writes it anew
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from zoo.robot import Variant
from zoo.variants import FAMILIES

PAGE = Path(__file__).parents[2] / "docs" / "recordings.md"
BEGIN, END = "<!-- zoo: written by `make zoo` -->", "<!-- end of zoo -->"


def table() -> str:
    """One row a family."""
    rows = [
        "| family | read as it is | read with an option | refused, with a line that says why |",
        "| --- | --- | --- | --- |",
    ]
    for family, listed in FAMILIES.items():
        plain = [each for each in listed if not each.refused and not each.options]
        helped = [each for each in listed if each.options and not each.refused]
        refused = [each for each in listed if each.refused]
        rows.append(f"| {family} | {_names(plain)} | {_names(helped)} | {_names(refused)} |")
    return "\n".join(rows)


def _names(listed: Sequence[Variant]) -> str:
    return "; ".join(f"{each.name} (`{' '.join(each.options)}`)" if each.options else each.name for each in listed)


def section() -> str:
    """The table with its count and its markers."""
    count = sum(len(listed) for listed in FAMILIES.values())
    return f"{BEGIN}\n{count} small recordings, each built in the test suite:\n\n{table()}\n{END}"


def written(page: str) -> str:
    """The page with the section as it should be. Raises `ValueError` where the markers are missing."""
    begin, end = page.index(BEGIN), page.index(END) + len(END)
    return page[:begin] + section() + page[end:]


def main() -> None:
    """Write the page anew."""
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
