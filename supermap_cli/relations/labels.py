"""What labels say of a relation: which things may contain others, and which have an upright surface to hang on."""

from __future__ import annotations


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_OPEN = _words(
    """armchair bar bed bench book carpet chair clock computer couch counter desk floor futon keyboard lamp laptop
    loveseat mat mattress monitor ottoman painting person piano picture plant pillow poster rug sofa stool table
    television tree tv worktop"""
)
"""Nouns of things within whose box others stand on, under or beside them, and not in them."""

_UPRIGHT = _words(
    """blackboard bookcase bookshelf cabinet closet column cupboard door divider fence fridge locker partition pillar
    refrigerator screen shelf wall wardrobe whiteboard window"""
)
"""Nouns of things with an upright surface that others hang on."""

_SHELVES = _words("bookcase bookshelf bookshelves cabinet rack shelf shelves shelving")
"""Nouns of furniture whose boards things stand on within its box."""


def may_contain(label: str) -> bool:
    """Whether things within the box of something with this label are in it."""
    return head_noun(label) not in _OPEN


def has_shelves(label: str) -> bool:
    """Whether things within the box of something with this label stand on its boards."""
    return head_noun(label) in _SHELVES


def is_upright_surface(label: str) -> bool:
    """Whether things hang on something with this label."""
    return head_noun(label) in _UPRIGHT


def head_noun(label: str) -> str:
    """The last word of a label, which says what kind of thing it is: "coffee table" is a table."""
    return label.rsplit(" ", 1)[-1].casefold()
