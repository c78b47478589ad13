"""`supermap localize`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.build import open_recording
from supermap_cli.commands.build_options import override, request
from supermap_cli.commands.common import (
    AlignOption,
    BackendOption,
    ClockOption,
    DbOption,
    EndOption,
    JsonOption,
    OdometryOption,
    RigOption,
    RobotOption,
    StartOption,
    database_url,
    err,
    interrupt_on_sigterm,
    out,
    print_json,
)
from supermap_cli.config import load_user_config

if TYPE_CHECKING:
    from supermap_cli.drivers.placing import LocalizedRecording

EXAMPLES = """
Examples:

    supermap localize today.mcap --db office.db

    supermap localize today.mcap --db office.db --end 10 --json
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(localize)


def localize(  # noqa: PLR0917 - a command line has many options
    recording: Annotated[Path, typer.Argument(help="A recording of a place that the map shows.", show_default=False)],
    db: DbOption = None,
    align: AlignOption = "auto",
    odometry: OdometryOption = None,
    option: BackendOption = None,
    rig: RigOption = None,
    clock: ClockOption = None,
    robot: RobotOption = None,
    start: StartOption = None,
    end: EndOption = None,
    json: JsonOption = False,
) -> None:
    """Tell where a recording's odometry stands in a map, without building it.

    It gives `T_map_odom`, by the registration that `supermap build` does: with it, a goal in the frame map can be given
    in the robot's odom frame, and `supermap navigate --from` takes the recording's last pose. Nothing is written. What
    cannot be placed with confidence is refused.
    """
    from supermap_cli.drivers.placing import localize_recording  # noqa: PLC0415 - heavy
    from supermap_cli.memory.opening import open_store  # noqa: PLC0415
    from supermap_cli.plugin_manager import load_plugins  # noqa: PLC0415

    interrupt_on_sigterm()
    config = override(
        load_user_config(Path.cwd()).build, odometry=odometry, options=option, rig=rig, clocks=clock, robot=robot
    )
    plugins = load_plugins()
    with open_store(database_url(db), read_only=True) as store:
        opened = open_recording(recording, request(config, start, end), plugins)
        with err().status("placing the recording in the map"):
            found = localize_recording(opened, plugins, config, store, align)
        warnings = (*opened.warnings, *found.placement.warnings)
    for warning in warnings:
        err().print(f"warning: {warning}", markup=False)
    if json:
        print_json(_document(recording, found, warnings))
    else:
        _print(recording, found)


def _document(path: Path, found: LocalizedRecording, warnings: tuple[str, ...]) -> dict[str, object]:
    x, y, z, yaw_deg = _level(found.placement.T_map_odom)
    last = _level(found.T_map_base)
    return {
        "recording": str(path),
        "frame_id": "map",
        "child_frame_id": "odom",
        "T_map_odom": [[round(float(value), 6) for value in row] for row in found.placement.T_map_odom],
        "position": [x, y, z],
        "yaw_deg": yaw_deg,
        "last_pose": {"position": list(last[:3]), "yaw_deg": last[3], "stamp_ns": int(found.last_ns)},
        "method": found.placement.method,
        "odometry": found.odometry,
        "warnings": list(warnings),
    }


def _level(T: object) -> tuple[float, float, float, float]:
    """x, y, z (m) and yaw (degrees) of a transform (4, 4)."""
    import numpy as np  # noqa: PLC0415 - keeps start-up light

    matrix = np.asarray(T, np.float64)
    yaw_deg = float(np.degrees(np.arctan2(matrix[1, 0], matrix[0, 0])))
    x, y, z = (round(float(value), 4) for value in matrix[:3, 3])
    return x, y, z, round(yaw_deg, 3)


def _print(path: Path, found: LocalizedRecording) -> None:
    console = out()
    x, y, z, yaw_deg = _level(found.placement.T_map_odom)
    console.print(f"{path.name}: {found.placement.method}", markup=False)
    console.print(f"T_map_odom: x {x:.3f} m, y {y:.3f} m, z {z:.3f} m, yaw {yaw_deg:.2f} degrees", markup=False)
    for row in found.placement.T_map_odom:
        console.print("  " + "  ".join(f"{float(value): .5f}" for value in row), markup=False)
    x, y, _, yaw_deg = _level(found.T_map_base)
    console.print(f"its last pose in the map: supermap navigate --from '{x:.2f} {y:.2f} {yaw_deg:.0f}'", markup=False)
