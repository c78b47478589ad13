"""Every recording of the zoo: `inspect` chooses the right topics, and `build` maps what is there or says why not."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from supermap_cli.errors import SupermapError
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.recordings import open_bag_recording
from zoo import documentation
from zoo.judging import built, chosen_roles, expected_roles, inspected, is_right, problem_lines, wanted
from zoo.robot import Variant
from zoo.scene import FRAMES, render, stamp
from zoo.variants import FAMILIES
from zoo.writing import write_variant

LARGEST_COLOR_ERROR = 20.0
"""Mean difference of a decoded image from what was written, of 255: Bayer loses some 10, swapped channels 60."""

ALL = [pytest.param(each, id=f"{family}: {each.name}") for family, listed in FAMILIES.items() for each in listed]


@pytest.mark.sqlite_only(reason="what is tried is the reading of recordings")
@pytest.mark.parametrize("variant", ALL)
def test_what_becomes_of_a_recording(variant: Variant, tmp_path):
    path = write_variant(variant, tmp_path)
    report = inspected(variant, path)
    if variant.refused:
        lines = [line.replace(str(path), "{path}") for line in problem_lines(report)]
        with pytest.raises(SupermapError) as raised:
            built(variant, path, load_plugins(), tmp_path)
        assert fits(str(raised.value).replace(str(path), "{path}"), variant.refused)
        assert not lines or any(fits(line, variant.refused) for line in lines)
        return
    assert problem_lines(report) == []
    chosen = chosen_roles(report)
    expected = expected_roles(variant)
    assert {role: chosen.get(role, "") for role in expected} == expected
    objects, warnings = built(variant, path, load_plugins(), tmp_path)
    assert is_right(objects, variant), objects
    said = "\n".join((*report.warnings, *warnings))
    assert [note for note in variant.notes if note not in said] == []
    check_colors(variant, path)


def fits(line: str, expected: str) -> bool:
    """Whether a line is the expected one, which may leave its end open."""
    return line.startswith(expected.removesuffix(" ...")) if expected.endswith(" ...") else line == expected


def check_colors(variant: Variant, path):
    """The first image, decoded, is what was written."""
    color = variant.robot.cameras[0].color
    frame = next(open_bag_recording(path, wanted(variant)).frames())
    index = min(range(FRAMES), key=lambda each: abs(stamp(each) - frame.stamp_ns))
    truth = render(index, color.offset, color.size, fisheye=color.model == "equidistant")[2]
    if color.encoding in {"mono8", "8UC1", "mono16"}:
        truth = cv2.cvtColor(cv2.cvtColor(truth, cv2.COLOR_RGB2GRAY), cv2.COLOR_GRAY2RGB)
    assert np.abs(frame.rgb.astype(float) - truth).mean() < LARGEST_COLOR_ERROR


def test_the_table_of_the_documentation_is_that_of_the_zoo():
    page = documentation.PAGE.read_text(encoding="utf-8")
    assert documentation.written(page) == page, "run `make zoo`"


def test_every_recording_has_a_name_of_its_own_and_a_source():
    for family, listed in FAMILIES.items():
        names = [each.name for each in listed]
        assert len(set(names)) == len(names), family
        assert all(each.source for each in listed), family
