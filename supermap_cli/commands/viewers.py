"""The options of a build that have it followed in a viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from supermap_cli.errors import ConfigError

RerunOption = Annotated[bool, typer.Option("--rerun", help="Start Rerun's viewer and show the build in it.")]
RerunConnectOption = Annotated[
    str | None,
    typer.Option(metavar="URL", help="Show the build in a running viewer, e.g. rerun+http://127.0.0.1:9876/proxy."),
]
RerunSaveOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Write what Rerun would show to a file (.rrd).")
]
_URL = ("rerun+http://", "rerun+https://", "rerun://")


def viewers(database: str, *, spawn: bool, connect: str | None, save: Path | None) -> dict[str, str]:
    """What `SessionContext.viewers` is to say. Raises `ConfigError` for more than one target and for a wrong one,
    `ExportError` where Rerun is missing or the file must not be written.
    """
    targets = [spawn, connect is not None, save is not None]
    if not any(targets):
        return {}
    if sum(targets) > 1:
        raise ConfigError("one viewer at a time", cure="give --rerun, --rerun-connect or --rerun-save")
    from supermap_cli.exporting.rerun_file import VIEWER, check_rerun  # noqa: PLC0415 - keeps start-up light

    check_rerun()
    if connect is not None:
        if not connect.startswith(_URL):
            raise ConfigError(
                f"--rerun-connect {connect}: no address of a viewer", cure="e.g. rerun+http://127.0.0.1:9876/proxy"
            )
        return {VIEWER: connect}
    if save is not None:
        from supermap_cli.output_files import check_output, refuse_files_of  # noqa: PLC0415

        if save.suffix.lower() != ".rrd":
            raise ConfigError(f"--rerun-save {save}: no .rrd file", cure="name a file that ends in .rrd")
        if not save.parent.is_dir():
            raise ConfigError(f"--rerun-save {save}: there is no such folder", cure="make it, or name another")
        check_output(save, "rrd", option="--rerun-save")
        if "://" not in database:
            refuse_files_of(Path(database), save, option="--rerun-save")
        return {VIEWER: str(save.resolve())}
    return {VIEWER: "spawn"}
