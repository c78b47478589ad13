"""`supermap inspect`: what is in a recording, and whether a build could work."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from supermap_cli.commands.common import (
    CameraOption,
    ClockOption,
    DetectionToleranceOption,
    EndOption,
    FrameOption,
    JsonOption,
    MountOption,
    RecordingLimitOption,
    RigOption,
    RobotOption,
    StartOption,
    TopicOption,
    err,
    out,
    print_json,
)
from supermap_cli.commands.failed_builds import last_failure
from supermap_cli.commands.tables import print_table

if TYPE_CHECKING:
    from rich.console import Console
    from rich.tree import Tree

    from supermap_cli.recordings.inspection import Inspection, RoleReport, TopicReport

EXAMPLES = """
Examples:

    supermap inspect run.mcap

    supermap inspect run.bag --topic color=/cam/image_raw --json

    supermap inspect run.bag --topic color.front=/front/image_raw --topic color.left=/left/image_raw
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(inspect)


def inspect(  # noqa: PLR0917 - a command line has many options
    recording: Annotated[Path, typer.Argument(help="A ROS 1 .bag, a ROS 2 .db3 or .mcap file, or a rosbag2 folder.")],
    topic: TopicOption = None,
    frame: FrameOption = None,
    mount: MountOption = None,
    rig: RigOption = None,
    clock: ClockOption = None,
    robot: RobotOption = None,
    camera: CameraOption = None,
    detection_tolerance: DetectionToleranceOption = None,
    limit: RecordingLimitOption = None,
    start: StartOption = None,
    end: EndOption = None,
    doctor: Annotated[
        bool, typer.Option("--doctor", help="Judge every role: good, weak or missing, with the option that mends it.")
    ] = False,
    write_config: Annotated[
        bool, typer.Option("--write-config", help="Write a supermap.toml here, with all choices made explicit.")
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Say what is in a recording, what a build would use, what is missing and how to mend it.

    Exit code 1 means that a build could not work.
    """
    from supermap_cli.commands.build_options import override, request  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.config import load_user_config  # noqa: PLC0415
    from supermap_cli.recordings.inspection import inspect_recording  # noqa: PLC0415

    config = override(
        load_user_config(Path.cwd()).build,
        topics=topic,
        frames=frame,
        mounts=mount,
        rig=rig,
        clocks=clock,
        robot=robot,
        camera=camera,
        detection_tolerance=detection_tolerance,
        limits=limit,
    )
    report = inspect_recording(recording, request(config, start, end))
    if as_json:
        print_json(to_document(report))
    elif doctor:
        _print_verdicts(report)
    else:
        _print(report)
    if write_config:
        _write_config(report)
    if (failure := last_failure(recording)) is not None:
        err().print(f"its last build failed: {failure}", markup=False, soft_wrap=True)
    for warning in report.warnings:
        err().print(f"warning: {warning}", markup=False)
    if not report.can_build:
        raise typer.Exit(1)


def _print_verdicts(report: Inspection) -> None:
    """Every role with its verdict; below those that are not good why, and what mends it."""
    console = out()
    width = max((len(each.role) for each in report.verdicts), default=0)
    console.print(f"{report.path}: {report.duration_s:.1f} s", markup=False)
    for each in report.verdicts:
        console.print(f"{each.role:<{width}}  {each.verdict:<8}{each.topic or ''}".rstrip(), markup=False)
        for text in (each.why, f"mend it: {each.cure}" if each.cure else ""):
            if text:
                console.print(f"{'':<{width}}    {text}", markup=False, soft_wrap=True)
    verdict = _verdict(report.without_detections) if report.can_build else "A build cannot work."
    console.print(f"\n{verdict}", markup=False, soft_wrap=True)


def _write_config(report: Inspection) -> None:
    """Write `supermap.toml`; one that is there stays as it is. Raises `ConfigError`."""
    from supermap_cli.errors import ConfigError  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.recordings.doctor import config_text  # noqa: PLC0415

    path = Path.cwd() / "supermap.toml"
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(config_text(report.settings, report.path.name))
    except FileExistsError as error:
        raise ConfigError("there is one already", where=str(path), cure="move it away, then try again") from error
    except OSError as error:
        raise ConfigError(f"cannot be written: {error.strerror}", where=str(path), cure="use another folder") from error
    err().print(f"{path} is written; `supermap build {report.path}` follows it", markup=False)


def to_document(report: Inspection) -> dict[str, object]:
    """The report as JSON values."""
    document = asdict(report)
    document["path"] = str(report.path)
    document["duration_s"] = report.duration_s
    document["can_build"] = report.can_build
    return document


def _print(report: Inspection) -> None:
    console = out()
    console.print(f"{report.path}: {report.duration_s:.1f} s, {report.usable_frames} usable frames", markup=False)
    columns = ("topic", "type", "messages#", "Hz#", "longest gap#", "frame", "used for")
    print_table(console, "", columns, (_topic_row(topic) for topic in report.topics))
    print_table(
        console,
        "A build would use",
        ("role", "topic", "why"),
        ((_role_text(role), role.topic or "-", role.reason) for role in report.roles),
    )
    console.print(f"motion: {report.poses or 'none'}; base frame: {report.base_frame or '?'}", markup=False)
    _print_cameras(console, report)
    _print_trees(console, report)
    if report.can_build:
        console.print(f"\n{_verdict(report.without_detections)}", markup=False, soft_wrap=True)
        return
    console.print("\nA build cannot work:")
    for problem in report.problems:
        where = f" ({problem.where})" if problem.where else ""
        console.print(f"  - {problem.what}{where}", markup=False)
        if problem.cure:
            console.print(f"    {problem.cure}", markup=False)


def _verdict(without_detections: str | None) -> str:
    if without_detections is None:
        return "A build can work."
    return f"A build can work if a detector model is given: no detections are recorded, and {without_detections}."


def _print_cameras(console: Console, report: Inspection) -> None:
    """One line for a lone camera, a table for several."""
    if len(report.cameras) < 2:
        console.print(f"camera: {report.camera or 'none'}", markup=False)
        return
    print_table(
        console,
        "Cameras",
        ("camera", "color topic", "frame", "model", "usable frames#"),
        (
            (camera.camera_id, camera.topic, camera.frame_id, camera.model, str(camera.usable_frames))
            for camera in report.cameras
        ),
    )


def _role_text(role: RoleReport) -> str:
    return role.role if role.camera is None else f"{role.role}.{role.camera}"


def _topic_row(topic: TopicReport) -> tuple[str, ...]:
    rate = "" if topic.rate_hz is None else f"{topic.rate_hz:.1f}"
    gap = "" if topic.longest_gap_s is None else f"{topic.longest_gap_s:.2f} s"
    if topic.has_gap:
        gap += f" at {topic.gap_at_s:.1f} s"
    return topic.topic, topic.type, str(topic.count), rate, gap, topic.frame_id, topic.role


def _print_trees(console: Console, report: Inspection) -> None:
    """The TF tree, one for each root; a frame that closes a loop is not followed again."""
    from rich.text import Text  # noqa: PLC0415 - keeps start-up light
    from rich.tree import Tree  # noqa: PLC0415

    children: dict[str, list[tuple[str, bool]]] = {}
    for edge in report.transforms:
        children.setdefault(edge.parent, []).append((edge.child, edge.static))
    below = {edge.child for edge in report.transforms}

    def grow(branch: Tree, frame: str, above: frozenset[str]) -> None:
        for child, static in children.get(frame, ()):
            sprout = branch.add(Text(child + ("" if static else "  (moves)")))
            if child not in above:
                grow(sprout, child, above | {child})

    for root in sorted(children.keys() - below):
        tree = Tree(Text(f"TF: {root}"))
        grow(tree, root, frozenset({root}))
        console.print(tree)
