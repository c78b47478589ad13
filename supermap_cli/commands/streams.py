"""Standard streams that are closed, full or gone, and how errors are told on them."""

from __future__ import annotations

import json
import os
import sys
from contextlib import suppress

import typer

from supermap_cli.errors import SupermapError
from supermap_cli.printable import printable_line

BROKEN_PIPE = 141
"""The exit code of a program whose reader has gone, as shells have it: 128 + SIGPIPE."""
JSON_ERRORS, DEBUG = "--json-errors", "--debug"
GLOBAL_FLAGS = (JSON_ERRORS, DEBUG)
"""Flags that stand anywhere in a command line."""


class OutputError(SupermapError):
    """Standard output cannot be written."""


def flags_first(arguments: list[str]) -> list[str]:
    """A command line with its global flags before all else."""
    until = arguments.index("--") if "--" in arguments else len(arguments)
    given = [flag for flag in GLOBAL_FLAGS if flag in arguments[:until]]
    rest = [argument for argument in arguments[:until] if argument not in GLOBAL_FLAGS]
    return [*given, *rest, *arguments[until:]]


def open_missing_streams() -> None:
    """Give the standard streams that are closed a descriptor, so that no file that is opened later becomes one.

    What is printed to a closed standard output is an error in the end (`finish_output`).
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    if sys.stdout is None:
        sys.stdout = open("/dev/full", "w", encoding="utf-8")  # noqa: PTH123, SIM115 - it is open until the end
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123, SIM115


def finish_output(code: int) -> int:
    """Write what is buffered for standard output. Returns the given exit code, or that of a failure to write."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _give_up_stdout()
        return BROKEN_PIPE
    except (OSError, ValueError) as error:
        _give_up_stdout()
        return tell(output_error(error))
    return code


def output_error(error: Exception) -> OutputError:
    """The error for output that cannot be written."""
    reason = getattr(error, "strerror", None) or error
    return OutputError(
        f"the output cannot be written: {reason}", where="stdout", cure="free space, or send it elsewhere"
    )


def os_error(error: OSError) -> SupermapError:
    """The error for a file that the system refuses; one without a name is standard output, and no more is tried."""
    if error.filename is None:
        _give_up_stdout()
        return output_error(error)
    cure = "check the path, the rights and the free space"
    return SupermapError(f"the system refuses: {error.strerror or error}", where=str(error.filename), cure=cure)


def tell(error: SupermapError) -> int:
    """Print an error as one line on stderr, after what had been warned of; as one JSON object where that is asked for.
    Returns its exit code.
    """
    if JSON_ERRORS in sys.argv:
        document = {
            "error": {
                "type": type(error).__name__,
                "message": str(error),
                "what": error.what,
                "where": error.where,
                "cure": error.cure,
                "exit_code": error.exit_code,
                "warnings": list(error.warnings),
            }
        }
        if (kind := getattr(error, "kind", None)) is not None:
            document["error"]["kind"] = kind
        line = json.dumps(document)
    else:
        lines = [f"warning: {printable_line(each)}" for each in error.warnings]
        line = "\n".join([*lines, f"error: {printable_line(str(error))}"])
    with suppress(OSError, ValueError):
        typer.echo(line, err=True)
    return error.exit_code


def _give_up_stdout() -> None:
    """Nothing more is written to it, not even at the interpreter's end."""
    with suppress(OSError):
        nothing = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nothing, sys.stdout.fileno())
        os.close(nothing)
