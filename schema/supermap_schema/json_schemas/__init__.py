"""JSON Schemas (draft 2020-12) of every document that leaves the program with `--json`.

`answer` (query), `show` (show), `object` (show ID), `history`, `diff`, `navigate`, `localize`, `inspect`, `build`,
`plugins`, `db_info`, `db_check`, `db_upgrade`, `db_sql`, `eval` (eval map, ..., eval all), `ablation` (eval
ablation), `benchmark` (eval benchmark), `bench`, `simulate`, `simulate_list` (simulate --list); and `truth`, the file
that `supermap simulate` writes beside its recordings.
"""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any


def schema_names() -> tuple[str, ...]:
    """The names `load_schema` knows, sorted."""
    found = (path.name for path in files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".schema.json") for name in found if name.endswith(".schema.json")))


def load_schema(name: str) -> dict[str, Any]:
    """The self-contained schema of one document. Raises `KeyError` for a name that there is none of."""
    path = files(__name__) / f"{name}.schema.json"
    if not path.is_file():
        raise KeyError(f"no schema {name!r}; there are {', '.join(schema_names())}")
    schema: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    definitions = json.loads((files(__name__) / "definitions.json").read_text(encoding="utf-8"))
    schema["$defs"] = definitions["$defs"] | schema.get("$defs", {})
    return schema
