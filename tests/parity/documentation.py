"""Measures how far every architecture is from transformers, and writes the table of docs/perception.md.

PYTHONPATH=tests:. python -m parity.documentation
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from parity import test_detr, test_grounding_dino, test_sam2
from parity.comparing import Difference, together

PAGE = Path(__file__).resolve().parents[2] / "docs" / "perception.md"
BEGIN, END = "<!-- parity -->", "<!-- /parity -->"
DETR = {"rt-detr": "RT-DETR", "d-fine": "D-FINE", "rf-detr": "RF-DETR", "rf-detr-seg": "RF-DETR-Seg"}


def rows(folder: Path) -> Iterator[tuple[str, str, Difference]]:
    """Architecture, what was asked, the largest differences."""
    phrases = test_grounding_dino.PHRASES
    for kind, name in (("grounding-dino", "Grounding DINO"), ("mm-grounding-dino", "MM Grounding DINO")):
        made = test_grounding_dino.make(kind, folder / kind)
        shapes = test_grounding_dino.SHAPES
        several = [test_grounding_dino.differences(made, shape, phrases) for shape in shapes]
        yield name, f"{len(phrases)} phrases at once", together(several)
        yield name, "one phrase", test_grounding_dino.differences(made, shapes[0], phrases[:1])
        parts = [test_grounding_dino.differences(made, shape, phrases, one_phrase=True) for shape in shapes[:2]]
        yield name, f"{len(phrases)} phrases, one a pass", together(parts)
    for kind, name in DETR.items():
        yield name, "all queries", test_detr.differences(kind, folder / kind)
    yield "SAM 2", "boxes as prompts", test_sam2.differences(folder / "sam2")


def row(name: str, asked: str, difference: Difference) -> str:
    """A line of the table."""
    boxes = (str(difference.boxes), f"{difference.boxes_px:.0e}") if difference.boxes else ("", "")
    masks = (str(difference.masks), f"{difference.mask_iou:.5f}") if difference.masks else ("", "")
    cells = (name, asked, boxes[0], boxes[1], f"{difference.scores:.0e}", str(difference.labels), *masks)
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Write the table into the page."""
    lines = [
        "| network | asked for | boxes | largest difference (px) | of scores | other labels | masks | least IoU |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, asked, difference in rows(Path(folder)):
            difference.check()
            lines.append(row(name, asked, difference))
            sys.stdout.write(f"{lines[-1]}\n")
            sys.stdout.flush()
    text = PAGE.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}\n{chr(10).join(lines)}\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
