"""What a user asks for, as the phrases that a model is given."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from supermap_cli.errors import DetectorError
from supermap_cli.input_files import read_class_names

_SEPARATORS = re.compile(r"[.?,;\s]+")
"""What parts phrases in a caption (`SPECIAL_TOKENS` of Grounding DINO: ".", "?"), and what parts them in a prompt:
within a phrase each is a space.
"""


def read_phrases(prompt: str | None, labels: Path | None, detector: str) -> tuple[str, ...]:
    """The phrases of a prompt and of a file, lower-case, each once, in their order.

    Raises `DetectorError` where there are none.
    """
    given: list[str] = re.split(r"[,;\n]", prompt or "")
    if labels is not None:
        given += read_class_names(labels, DetectorError, option=f"{detector}.labels")
    phrases = normal_phrases(given)
    if not phrases:
        raise DetectorError(
            f"the detector {detector} has not been told what to look for",
            cure=f'say --option {detector}.prompt="chair, plant, trash can", or --option {detector}.labels=FILE',
        )
    return phrases


def normal_phrases(given: Iterable[str]) -> tuple[str, ...]:
    """Lower-case phrases with single spaces and without marks that part phrases; each once, none empty."""
    phrases = (_SEPARATORS.sub(" ", phrase.lower()).strip() for phrase in given)
    return tuple(dict.fromkeys(phrase for phrase in phrases if phrase))
