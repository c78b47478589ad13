"""Numbers of a command line that nothing can be reckoned with are refused by the option that gave them, in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from supermap_cli.commands.build_options import override
from supermap_cli.config import BuildConfig
from supermap_cli.errors import AlignmentError, ConfigError, SupermapError
from supermap_cli.mapping.alignment import parse_placement
from supermap_cli.mapping.structure import first_of_each
from supermap_cli.recordings.mounting import parse_mounts
from supermap_cli.recordings.sensor_clocks import check_clocks
from support import bags, kitchen
from support.cli import supermap

LARGE = ("9223372036854775808", "9" * 30)


@pytest.fixture(scope="module")
def db(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return kitchen.make_kitchen(tmp_path_factory.mktemp("kitchen") / "map.db")


@pytest.mark.parametrize("number", LARGE)
@pytest.mark.parametrize("command", [("show",), ("query", "chairs"), ("db", "sql", "SELECT 1")])
def test_a_limit_beyond_64_bits_is_refused(db: Path, command: tuple[str, ...], number: str) -> None:
    refused = supermap(*command, "--db", db, "--limit", number).exception
    assert isinstance(refused, ConfigError)
    assert "--limit takes no such large number" in str(refused)
    assert supermap(*command, "--db", db, "--limit", str(2**53)).exit_code == 0


@pytest.mark.parametrize("number", LARGE)
def test_a_seed_beyond_64_bits_is_refused(tmp_path: Path, number: str) -> None:
    refused = supermap("simulate", "room", "--out", tmp_path / "room", "--seed", number).exception
    assert isinstance(refused, ConfigError)
    seeds = supermap("eval", "benchmark", "room", "--seeds", number * 300).exception
    assert "--seeds" in str(seeds)


@pytest.mark.parametrize(
    ("option", "given", "message"),
    [
        ("limits", "x=1", "--limit x: there is no such entry"),
        ("limits", "image_pixels=many", "--limit image_pixels: 'many' is no whole number"),
        ("limits", "image_pixels=0", "--limit image_pixels: it must be greater than 0, not '0'"),
        ("limits", f"image_pixels={'9' * 5000}", "--limit image_pixels: '9999999999999999999... is no whole number"),
        ("clocks", "/odom=soon", "--clock /odom: 'soon' is no number"),
        ("ablate", "everything", "--ablate: 'everything' is none of 'tracker', 'semantic-fusion'"),
    ],
)
def test_a_wrong_option_is_told_by_its_name(option: str, given: str, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        override(BuildConfig(), **{option: [given]})  # type: ignore[arg-type]
    assert str(refused.value).startswith(message)


def test_a_rate_is_told_by_its_option() -> None:
    with pytest.raises(ConfigError, match="--rate: it must be less than or equal to 100, not 1000"):
        override(BuildConfig(), rate=1000)


@pytest.mark.parametrize("offset_s", [9.9e9, -9.9e9, 1e300, float("nan")])
def test_no_clock_is_off_by_more_than_stamps_hold(offset_s: float) -> None:
    with pytest.raises(ConfigError, match="no offset between two clocks"):
        check_clocks({"/odom": offset_s}, ["/odom"])
    check_clocks({"/odom": 1.8e9}, ["/odom"])


@pytest.mark.parametrize(("name", "x"), [("camera", "1e8"), ("lidar", "-101"), ("arm", "1e300")])
def test_nothing_is_mounted_out_of_reach(name: str, x: str) -> None:
    with pytest.raises(ConfigError, match="m away: write the position in metres"):
        parse_mounts({name: f"{x} 0 0 0 0 0"})


@pytest.mark.parametrize("text", ["1e300 0 0 0", "0 -1e5 0 0"])
def test_no_traversal_is_placed_out_of_reach(text: str) -> None:
    with pytest.raises(AlignmentError, match="more than 10000 m away"):
        parse_placement(text, np.eye(4))


def test_points_far_apart_are_thinned_too() -> None:
    points = np.array([[0.0, 0, 0], [1e9, 1e9, 1e9], [0.01, 0.01, 0.01], [-1e9, 0, 0]])
    assert first_of_each(points, 0.05).tolist() == [0, 1, 3]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bags.write_recording(tmp_path_factory.mktemp("bag") / "run.mcap")


NO_TIMES = [
    (option, value)
    for option in ("--start", "--end", "--detection-tolerance", "--rate", "--clock")
    for value in ("nan", "inf", "-inf", "1e30", "-1e30", "-1")
    if (option, value) != ("--clock", "-1")
]


@pytest.mark.parametrize(("option", "value"), NO_TIMES)
def test_times_that_are_none_are_one_line(recording: Path, option: str, value: str) -> None:
    given_value = f"/camera/color/image_raw={value}" if option == "--clock" else value
    result = supermap("build", recording, option, given_value, "--db", recording.with_suffix(".db"))
    assert isinstance(result.exception, SupermapError), result.output
    said = str(result.exception)
    assert "\n" not in said
    assert len(said) < 300
    assert option in said
