"""`supermap navigate`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import (
    DbOption,
    JsonOption,
    check_outputs,
    database_url,
    err,
    out,
    print_json,
    sane,
)
from supermap_cli.commands.tables import position_text, print_table
from supermap_cli.errors import ConfigError, QueryError

if TYPE_CHECKING:
    from supermap_cli.navigation.route import PlannedRoute, Waypoint
    from supermap_cli.query.clock import Clock

EXAMPLES = """
Examples:

    supermap navigate "go to the whiteboard next to the painting, then to the painting next to the fridge"

    supermap navigate "visit all chairs" --robot-radius 0.3 --plot route.png

    supermap navigate "go to chair-1" --from "1.5 -2 90" --nav2 goals.yaml

    supermap navigate "drive to the desk and then to the door" --mcap route.mcap --json
"""
MOST_RADIUS_M = 5.0
"""m; a robot with a larger radius stands in no room."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(navigate)


def navigate(  # noqa: PLR0917 - typer makes its options of them
    text: Annotated[list[str], typer.Argument(metavar="TEXT", help="e.g. 'go to the desk, then to a chair near it'")],
    db: DbOption = None,
    json: JsonOption = False,
    start: Annotated[
        str | None,
        typer.Option(
            "--from", metavar="'X Y YAW'", help="Where the robot is, in m and degrees. [default: its last pose]"
        ),
    ] = None,
    robot_radius: Annotated[
        float | None, typer.Option(min=0.01, max=MOST_RADIUS_M, callback=sane, help="m. [default: 0.22]")
    ] = None,
    standoff: Annotated[
        float | None,
        typer.Option(min=0, max=100, callback=sane, help="m between the robot's centre and a thing. [default: 0.8]"),
    ] = None,
    robot_height: Annotated[
        float | None,
        typer.Option(min=0.05, max=10, callback=sane, help="m that must be free. [default: just above its cameras]"),
    ] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="A plan from above: .png, .svg or .pdf.")] = None,
    nav2: Annotated[
        Path | None, typer.Option(metavar="FILE.yaml", help="The goal of nav2's FollowWaypoints, with its poses.")
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(metavar="FILE.mcap", help="The way and the goals as ROS messages, to look at.")
    ] = None,
    language: Annotated[
        str | None, typer.Option(metavar="CODE", help="The instruction's language: en, de, es, fr, zh. [default: told]")
    ] = None,
) -> None:
    """Turn an instruction into poses for a robot.

    Each goal is understood as `supermap query` understands it, and becomes a pose in the frame `map`: on floor that was
    seen free, reachable over such floor, facing the thing from a side that it was seen from. What has gone, what fits
    several things, and what has no free place before it is told instead; nothing is guessed.
    """
    from supermap_cli.memory import open_store  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.navigation.observed_space import occupancy_grid  # noqa: PLC0415
    from supermap_cli.navigation.parameters import ROBOT_RADIUS_M, STANDOFF_M  # noqa: PLC0415
    from supermap_cli.navigation.route import DrivingRobot, plan_route  # noqa: PLC0415
    from supermap_cli.query.clock import clock_of  # noqa: PLC0415
    from supermap_cli.query.views import to_document  # noqa: PLC0415

    pose = None if start is None else pose_of(start)
    radius_m = ROBOT_RADIUS_M if robot_radius is None else robot_radius
    robot = DrivingRobot(radius_m, STANDOFF_M if standoff is None else standoff, robot_height)
    with open_store(database_url(db), read_only=True) as store:
        if plot is not None:
            _check_plot(plot)
        check_outputs(store, {"--plot": (plot, None), "--nav2": (nav2, "nav2"), "--mcap": (mcap, "route")})
        with store.reader() as reader, err().status("looking where the floor is free"):
            grid = occupancy_grid(reader, robot.height_m)
            route = plan_route(reader, " ".join(text), robot, pose, language=language, grid=grid)
            clock = clock_of(reader)
    if json:
        print_json(to_document(route))
    else:
        _print(route, clock)
    if plot is not None:
        from supermap_cli.reports.route_plot import draw_route  # noqa: PLC0415 - keeps start-up light

        draw_route(route, grid, plot)
    if nav2 is not None or mcap is not None:
        _write_goals(route, nav2, mcap)


def pose_of(text: str) -> tuple[float, float, float]:
    """'X Y YAW' in m and degrees as metres and radians. Raises `ConfigError` for anything else."""
    try:
        x, y, yaw_deg = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        x = y = yaw_deg = math.nan
    if not all(abs(value) < 1e6 for value in (x, y, yaw_deg)):
        raise ConfigError(
            f"--from {text!r} is no pose", cure="give x and y in m and yaw in degrees: --from '1.5 -2 90'"
        )
    return x, y, math.radians(yaw_deg)


def _check_plot(path: Path) -> None:
    from supermap_cli.reports.diff_plot import SUFFIXES  # noqa: PLC0415 - keeps start-up light

    if path.suffix.lower() not in SUFFIXES:
        raise QueryError("a picture of an unknown kind", where=str(path), cure="name a .png, .svg or .pdf file")


def _write_goals(route: PlannedRoute, nav2: Path | None, mcap: Path | None) -> None:
    from supermap_cli.exporting.route_goals import (  # noqa: PLC0415 - keeps start-up light
        check_complete,
        follow_waypoints_yaml,
        route_mcap,
    )
    from supermap_cli.output_files import replace_file  # noqa: PLC0415

    check_complete(route)
    if nav2 is not None:
        replace_file(nav2, follow_waypoints_yaml(route).encode())
    if mcap is not None:
        replace_file(mcap, route_mcap(route))


def _print(route: PlannedRoute, clock: Clock) -> None:
    console = out()
    columns = ("", "goal", "thing", "position (m)", "x (m)#", "y (m)#", "yaw (deg)#", "way (m)#", "", "last seen")
    print_table(console, "", columns, (_row(n, waypoint, clock) for n, waypoint in enumerate(route.waypoints, start=1)))
    for number, waypoint in enumerate(route.waypoints, start=1):
        console.print(f"{number}. {waypoint.message}", markup=False)
        for note in waypoint.notes:
            console.print(f"   note: {note}", markup=False)
        for thing in waypoint.candidates:
            away = "" if thing.distance_m is None else f", {thing.distance_m:.2f} m from there"
            place = thing.place or f"{thing.id} stands at ({', '.join(f'{value:.2f}' for value in thing.position)}) m"
            console.print(f"   - {place.rstrip('.')}{away}", markup=False)
    for note in route.notes:
        console.print(f"note: {note}", markup=False)
    console.print(
        f"poses in the frame map; a robot of radius {route.robot_radius_m:g} m and height {route.robot_height_m:g} m; "
        f"{route.free_m2:.1f} m2 of floor seen free until {clock.text(route.seen_until_ns)}",
        markup=False,
    )


def _row(number: int, waypoint: Waypoint, clock: Clock) -> tuple[str, ...]:
    thing, pose = waypoint.thing, waypoint.pose
    named = ("-", "-") if thing is None else (thing.id, position_text(thing.position))
    placed = ("-", "-", "-")
    if pose is not None:
        x, y, _ = pose.position
        placed = (f"{x:.2f}", f"{y:.2f}", f"{math.degrees(pose.yaw):.0f}")
    length = "-" if waypoint.length_m is None else f"{waypoint.length_m:.1f}"
    seen = "-" if thing is None else clock.brief(thing.last_seen_ns)
    return (str(number), waypoint.goal, *named, *placed, length, waypoint.status, seen)
