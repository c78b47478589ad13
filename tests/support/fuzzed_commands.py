"""Runs commands whose command lines, maps or settings are hostile."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from typing import Any

from typer.main import get_command

from supermap_cli.errors import SupermapError
from supermap_cli.main import make_app


@cache
def _command() -> Any:
    """The whole command line, made once: that takes as long as a short answer."""
    return get_command(make_app())


def run(arguments: Sequence[str]) -> tuple[int, str]:
    """The exit code and what is printed on stdout: an answer, a usage error (2), or an error of one line (1).

    Whatever else a command raises is a bug.
    """
    given = [str(each) for each in arguments]
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8") for _ in range(2))
    argv, sys.argv = sys.argv, ["supermap", *given]
    code, message = 0, "-"
    try:
        with redirect_stdout(out), redirect_stderr(err):
            _command().main(given, prog_name="supermap")
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    except (SupermapError, OSError) as error:
        code, message = 1, str(error)
    finally:
        sys.argv = argv
    assert message, given
    assert "\n" not in message, given
    out.flush()
    return code, out.buffer.getvalue().decode("utf-8", "replace")  # type: ignore[attr-defined]
