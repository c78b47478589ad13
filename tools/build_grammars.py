"""Prepares the grammars that SuperMap ships: `supermap_cli/language/grammars/*.lark` -> `*.json` beside them.

    python tools/build_grammars.py

Run it after a grammar was changed; a test fails where it was forgotten. See `supermap_cli.language.prepared`.
"""

from __future__ import annotations

from pathlib import Path

from supermap_cli.language.prepared import as_json

GRAMMARS = Path(__file__).resolve().parents[1] / "supermap_cli" / "language" / "grammars"


def main() -> None:
    """Writes all of them."""
    for source in sorted(GRAMMARS.glob("*.lark")):
        text = as_json(source.read_text(encoding="utf-8"))
        source.with_suffix(".json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
