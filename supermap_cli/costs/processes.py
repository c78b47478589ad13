"""Runs a measurement in a fresh process, so that none counts another's memory."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, TypeAdapter

from supermap_cli.costs.job import CostJob, Run
from supermap_cli.errors import SupermapError

ResultT = TypeVar("ResultT")
RunT = TypeVar("RunT", bound=Run)


def run_job(job: CostJob, result_type: type[RunT], folder: Path) -> RunT:
    """Run a cost measurement in a process of its own. Raises as `run_process`."""
    return run_process("supermap_cli.costs", job, result_type, folder / job.db.stem)


def run_process(module: str, job: BaseModel, result_type: type[ResultT], file_stem: Path) -> ResultT:
    """Run `python -m module` on a job; job and result go through JSON files whose names begin as `file_stem`.

    Raises the `SupermapError` that ended the process, and one if it was killed.
    """
    job_file, result_file = (file_stem.with_name(f"{file_stem.name}.{what}.json") for what in ("job", "result"))
    job_file.write_text(job.model_dump_json(), encoding="utf-8")
    result_file.unlink(missing_ok=True)
    command = [sys.executable, "-P", "-m", module, str(job_file), str(result_file)]
    process = subprocess.run(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)  # noqa: S603 - ours
    if process.returncode < 0:
        raise SupermapError(
            f"the measured process was ended by signal {-process.returncode}",
            where=module,
            cure="free memory, or measure less",
        )
    if process.returncode or not result_file.is_file():
        raise RuntimeError(f"measuring with {module} failed with exit code {process.returncode}, see above")
    result = json.loads(result_file.read_text(encoding="utf-8"))
    job_file.unlink()
    result_file.unlink()
    if "error" in result:
        raise SupermapError(result["error"]["what"], where=result["error"]["where"], cure=result["error"]["cure"])
    return TypeAdapter(result_type).validate_python(result["run"])
