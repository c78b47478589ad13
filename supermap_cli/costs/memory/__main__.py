"""`python -m supermap_cli.costs.memory JOB RESULT`: measures one question; both files are JSON."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from supermap_cli.costs.memory.question_cost import QuestionJob, measure_question
from supermap_cli.errors import SupermapError
from supermap_cli.query.views import to_document


def main(job: Path, result: Path) -> None:
    """Run the job; a `SupermapError` is written to the result file like a result."""
    try:
        found = {"run": to_document(measure_question(QuestionJob.model_validate_json(job.read_text(encoding="utf-8"))))}
    except SupermapError as error:
        found = {"error": {"what": error.what, "where": error.where, "cure": error.cure}}
    result.write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
