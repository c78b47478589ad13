"""Refusals: why a question gets no answer, in words for people and as a kind for programs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from supermap_cli.errors import QueryError

RefusalKind = Literal[
    "empty", "too long", "unknown word", "not understood", "no question about the place", "unknowable", "viewpoint"
]
"""Kinds of refusal.

- "empty", "too long": nothing to read, or more than is read.
- "unknown word": a word that neither the language nor the map knows.
- "not understood": every word is known, but a part of the sentence could not be used for an answer.
- "no question about the place": a command, a greeting, another topic.
- "unknowable": what no map holds (whether a door is open, who owns a thing).
- "viewpoint": left, right, in front or behind, without a word on from where.
"""


class RefusedQuestionError(QueryError):
    """A question that is refused; `kind` says why, `part` is the part of it that was the reason.

    `near` are words that may have been meant, `language` is the one (ISO 639-1) that it is refused in.
    """

    def __init__(
        self,
        kind: RefusalKind,
        what: str,
        *,
        part: str | None = None,
        where: str | None = None,
        cure: str | None = None,
        near: Sequence[str] = (),
        language: str = "en",
    ) -> None:
        self.kind = kind
        self.part = part
        self.near = tuple(near)
        self.language = language
        super().__init__(what, where=where, cure=cure)
