"""Builds `supermap_cli/language/lexicons/en_words.txt`: the English words that are never taken for misspelt ones.

    python tools/build_words.py --wordnet /usr/share/wordnet

From WordNet 3.0 (the files `index.noun`, `index.verb`, `index.adj`; Debian's package `wordnet-base`) it takes the words
of 3 to 9 letters with a sense that occurs in WordNet's tagged texts.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

RESULT = Path(__file__).resolve().parents[1] / "supermap_cli" / "language" / "lexicons" / "en_words.txt"
LETTERS = range(3, 10)
"""Letters of a word; in a longer one a single wrong letter is hardly another word. Chosen."""


def words(index: Path) -> Iterator[str]:
    """The words of an index file (wndb(5WN)): lemma, part of speech, senses, n pointers, ..., tagged senses."""
    for line in index.read_text(encoding="utf-8").splitlines():
        if line.startswith(" "):
            continue
        fields = line.split()
        tagged = int(fields[5 + int(fields[3])])
        if tagged and len(fields[0]) in LETTERS and fields[0].isascii() and fields[0].isalpha():
            yield fields[0]


def main() -> None:
    """Writes the list."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--wordnet", type=Path, required=True)
    folder: Path = parser.parse_args().wordnet
    found = {word for part in ("noun", "verb", "adj") for word in words(folder / f"index.{part}")}
    RESULT.write_text("\n".join(sorted(found)) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
