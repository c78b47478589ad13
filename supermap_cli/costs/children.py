"""Runs measurements one after the other, each in a fresh process, so that none counts another's memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter

from supermap_cli.costs.job import Job, Run
from supermap_cli.errors import SupermapError

R = TypeVar("R", bound=Run)


def run_apart(job: Job, kind: type[R], folder: Path) -> R:
    """What a job's process found. Raises the `SupermapError` that ended it, and one if it was killed."""
    asked, found = folder / f"{job.db.stem}.job.json", folder / f"{job.db.stem}.result.json"
    asked.write_text(job.model_dump_json(), encoding="utf-8")
    command = [sys.executable, "-P", "-m", "supermap_cli.costs", str(asked), str(found)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)  # noqa: S603 - ours
    if done.returncode < 0:
        raise SupermapError(
            f"the measured process was ended by signal {-done.returncode}",
            where=job.what,
            cure="free memory, or measure a shorter part with --end",
        )
    if done.returncode or not found.is_file():
        raise RuntimeError(f"measuring {job.what!r} failed with exit code {done.returncode}, see above")
    answer = json.loads(found.read_text(encoding="utf-8"))
    if "error" in answer:
        raise SupermapError(answer["error"]["what"], where=answer["error"]["where"], cure=answer["error"]["cure"])
    return TypeAdapter(kind).validate_python(answer["run"])
