"""`supermap record-profile`: the line that records a robot like that of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from supermap_cli.commands.common import (
    ClockOption,
    FrameOption,
    MountOption,
    RecordingLimitOption,
    RigOption,
    RobotOption,
    TopicOption,
    err,
    out,
)

EXAMPLES = """
Examples:

    supermap record-profile run.mcap

    supermap record-profile run.mcap > record.sh
"""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command("record-profile", epilog=EXAMPLES)(record_profile)


def record_profile(  # noqa: PLR0917 - a command line has many options
    recording: Annotated[Path, typer.Argument(help="A recording of such a robot, as for `supermap inspect`.")],
    topic: TopicOption = None,
    frame: FrameOption = None,
    mount: MountOption = None,
    rig: RigOption = None,
    clock: ClockOption = None,
    robot: RobotOption = None,
    limit: RecordingLimitOption = None,
) -> None:
    """Print how to record a robot like this one: the topics that a build uses, and no others.

    What is printed is a script for a shell: `ros2 bag record` with MCAP, compressed so that it can be read at once, and
    the quality of service with which mountings (/tf_static) are caught that were published before.
    """
    from supermap_cli.commands.build_options import override, request  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.config import load_user_config  # noqa: PLC0415
    from supermap_cli.errors import RecordingError  # noqa: PLC0415
    from supermap_cli.recordings.opening import open_recording  # noqa: PLC0415
    from supermap_cli.recordings.record_profile import record_profile as profile_of  # noqa: PLC0415

    config = override(
        load_user_config(Path.cwd()).build,
        rig=rig,
        topics=topic,
        frames=frame,
        mounts=mount,
        clocks=clock,
        robot=robot,
        limits=limit,
    )
    opened = open_recording(recording, request(config, None, None))
    if not opened.rig.plan.choices:
        raise RecordingError(
            "no topic that a build uses is known here",
            where=str(recording),
            cure="`supermap inspect` says what is in it; name topics with --topic ROLE=TOPIC",
        )
    profile = profile_of(opened)
    console = out()
    for line in profile.script().splitlines():
        console.print(line, markup=False, soft_wrap=True)
    for note in profile.notes:
        err().print(f"note: {note}", markup=False)
