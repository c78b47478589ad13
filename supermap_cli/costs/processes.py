"""Runs measurements one after the other, each in a fresh process, so that none counts another's memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter

from supermap_cli.costs.job import Job, Run
from supermap_cli.errors import SupermapError

R = TypeVar("R")
K = TypeVar("K", bound=Run)


def run_job(job: Job, kind: type[K], folder: Path) -> K:
    """What a job's process found. Raises the `SupermapError` that ended it, and one if it was killed."""
    return run_process("supermap_cli.costs", job, kind, folder / job.db.stem)


def run_process(module: str, job: BaseModel, kind: type[R], beside: Path) -> R:
    """What a module found that was given a job; both go through files whose names begin as `beside`.

    Raises the `SupermapError` that ended it, and one if it was killed.
    """
    asked, found = (beside.with_name(f"{beside.name}.{what}.json") for what in ("job", "result"))
    asked.write_text(job.model_dump_json(), encoding="utf-8")
    found.unlink(missing_ok=True)
    command = [sys.executable, "-P", "-m", module, str(asked), str(found)]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)  # noqa: S603 - ours
    if done.returncode < 0:
        raise SupermapError(
            f"the measured process was ended by signal {-done.returncode}",
            where=module,
            cure="free memory, or measure less",
        )
    if done.returncode or not found.is_file():
        raise RuntimeError(f"measuring with {module} failed with exit code {done.returncode}, see above")
    answer = json.loads(found.read_text(encoding="utf-8"))
    asked.unlink()
    found.unlink()
    if "error" in answer:
        raise SupermapError(answer["error"]["what"], where=answer["error"]["where"], cure=answer["error"]["cure"])
    return TypeAdapter(kind).validate_python(answer["run"])
