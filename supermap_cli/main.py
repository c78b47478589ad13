"""The command line: the Typer app and the one error boundary."""

from __future__ import annotations

import os
import sys
import traceback
from typing import Annotated

import typer

from supermap_cli.commands import (
    bench,
    build,
    config,
    db,
    demo,
    diff,
    evaluate,
    export,
    history,
    inspect,
    localize,
    mcp,
    models,
    navigate,
    plugins,
    query,
    record_profile,
    show,
    simulate,
)
from supermap_cli.commands.from_plugins import CommandGroup
from supermap_cli.commands.streams import (
    BROKEN_PIPE,
    DEBUG,
    JSON_ERRORS,
    finish_output,
    open_missing_streams,
    os_error,
    tell,
)
from supermap_cli.errors import SupermapError
from supermap_cli.version import __version__

MAX_IMAGE_PIXELS = 1 << 27
"""Pixels that OpenCV decodes at most: 134 million, 400 MB in colour, several times the largest camera's."""

EXAMPLES = """
Examples:

    supermap build run.mcap

    supermap query "chair near the tv"
"""


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"supermap {__version__}")
        raise typer.Exit


def make_app() -> typer.Typer:
    """The whole command line; the commands of plugins are added when one is asked for."""
    app = typer.Typer(
        name="supermap",
        cls=CommandGroup,
        help="Turn a robot's recording into a 4D memory, and ask it.",
        epilog=EXAMPLES,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback()
    def supermap(
        version: Annotated[
            bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
        ] = False,
        json_errors: Annotated[
            bool, typer.Option(JSON_ERRORS, help="Print errors as JSON on stderr; anywhere in the line.")
        ] = False,
        debug: Annotated[
            bool, typer.Option(DEBUG, help="Print the traceback of an error, too; anywhere in the line.")
        ] = False,
    ) -> None:
        """Turn a robot's recording into a 4D memory, and ask it."""

    for command in (
        build,
        inspect,
        record_profile,
        query,
        show,
        history,
        diff,
        navigate,
        localize,
        mcp,
        export,
        simulate,
        evaluate,
        bench,
        demo,
        models,
        plugins,
        config,
        db,
    ):
        command.register(app)
    return app


def main() -> None:
    """Run the command line; a `SupermapError` becomes one line on stderr and exit code 1, and so does what the system
    refuses. With `--debug` the traceback of either is shown, too.
    """
    # Before numpy is loaded: waking OpenBLAS's threads for (n, 3) arrays takes far longer than what they compute.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", str(MAX_IMAGE_PIXELS))  # read when OpenCV is imported
    open_missing_streams()
    code = 0
    try:
        make_app()()
    except BrokenPipeError:
        code = BROKEN_PIPE
    except (SupermapError, OSError) as error:
        if DEBUG in sys.argv:
            traceback.print_exc()
        code = tell(error if isinstance(error, SupermapError) else os_error(error))
    except SystemExit as stopped:
        code = stopped.code if isinstance(stopped.code, int) else int(stopped.code is not None)
    sys.exit(finish_output(code))


if __name__ == "__main__":
    main()
