"""Writing of report files."""

from __future__ import annotations

from pathlib import Path

from supermap_cli.output_files import check_output, replace_file


def write_file(path: Path, content: str | bytes, kind: str, *, option: str) -> None:
    """Write a file of a kind of `output_files.KINDS`, creating its folder; a failure leaves what was there.

    Raises `ExportError` where it cannot be written, or where there is a file of another kind. `option` is the option
    that named it, for messages.
    """
    check_output(path, kind, option=option)
    replace_file(path, content.encode() if isinstance(content, str) else content)
