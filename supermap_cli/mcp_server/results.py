"""What tools answer: documents by the published schemas, with what an agent must know to trust them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from supermap_cli.memory_api import Memory
from supermap_cli.query.answers import Answer
from supermap_cli.query.views import to_document

MOST_LOOKS = 20
"""Things of an answer whose last look is told."""


def with_last_looks(memory: Memory, document: dict[str, Any], ids: Iterable[str]) -> dict[str, Any]:
    """A document with `last_looked_at` of some things, and `memory`: until when anything was seen at all."""
    clock = memory.clock()
    looks = memory.last_looks(*list(dict.fromkeys(ids))[:MOST_LOOKS])
    told = {
        look.id: {
            "last_seen": clock.text(look.last_seen_ns),
            "last_seen_ns": look.last_seen_ns,
            "place_in_view_until": None if look.looked_at_in is None else clock.text(look.looked_at_until_ns),
            "traversal": look.looked_at_in,
        }
        for look in looks
    }
    return {**document, "last_looked_at": told, "memory": about_memory(memory)}


def about_memory(memory: Memory) -> dict[str, Any]:
    """Until when the robot saw anything, and whether a build is under way: whatever happened later, nobody knows."""
    traversals = memory.traversals()
    clock = memory.clock()
    with memory.reader() as reader:
        now_ns = reader.now_ns
    return {
        "seen_until": clock.text(now_ns),
        "seen_until_ns": now_ns,
        "traversals": len(traversals),
        "being_built": any(traversal.status == "building" for traversal in traversals),
    }


def answer_document(memory: Memory, answer: Answer) -> dict[str, Any]:
    """An answer, with what is unknown and when its things were last looked at."""
    ids = [instance.id for instance in answer.instances] + [near.id for near in answer.nearest]
    return with_last_looks(memory, to_document(answer), ids)
