"""Evidence of absence, added up over looks of which each can judge only a part of the place."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, IntArray

ABSENT_SHARE = 0.6
ABSENT_LOOKS = 3
"""Gone: more than this share of what can be seen of its place was looked through, in that many looks."""

OBSERVABLE_SHARE = 0.3
"""Share of an object's voxels an image must be able to speak of before silence or emptiness counts against it."""

EMPTY_SHARE = ABSENT_SHARE * OBSERVABLE_SHARE
"""Share of all its voxels seen through, in looks of parts, that means as much as a look at so much of the whole."""

LEAST_THROUGH = 30
"""Fewer voxels than this are those of a few rays, whose errors they share."""

LEAST_SHARE = 0.01
"""A look that can speak of fewer of an object's voxels than this says nothing: strays and rims."""


@dataclass
class EmptyRun:
    """Looks at parts of an object's place since it has been found empty, and what they last said of each voxel.

    A thing is there as a whole or is gone as a whole, from some time on. So a run begins with a look that goes through
    what it can see of the object, and was none once all that has been judged since no longer says that it went: a
    change point, as in a cumulative sum test (Page 1954). `codes` (n,) are the voxels it is about, `judged` and
    `through` (n,) those of which a look could speak, and those that the last such look went through; `looks` of them
    found a part empty, the first at `began_ns`.
    """

    codes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    judged: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    through: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    looks: int = 0
    began_ns: int = 0

    def take_in(self, codes: IntArray, judged: BoolArray, through: BoolArray, stamp_ns: int) -> None:
        """Add a look at the voxels `codes`, of which it judges (n,) some and goes `through` (n,) some of these; other
        voxels than before begin a new run.
        """
        if self.codes is not codes:
            self.looks = 0
        told = np.count_nonzero(judged)
        if told <= LEAST_SHARE * len(codes):
            return
        emptied = np.count_nonzero(through) > ABSENT_SHARE * told
        if self.looks == 0:
            if not emptied:
                return
            self.codes, self.began_ns = codes, stamp_ns
            self.judged, self.through = np.zeros(len(codes), bool), np.zeros(len(codes), bool)
        self.looks += int(emptied)
        self.judged |= judged
        self.through[judged] = through[judged]
        if np.count_nonzero(self.through) <= ABSENT_SHARE * np.count_nonzero(self.judged):
            self.end()

    def end(self) -> None:
        """The object was seen in its place: no look before says that it went."""
        self.looks = 0

    def shows_absence(self, reachable: float) -> bool:
        """Whether so much of an object, of which rays can reach so many voxels, was seen through that it has gone."""
        through = int(np.count_nonzero(self.through))
        return self.looks >= ABSENT_LOOKS and through >= max(LEAST_THROUGH, EMPTY_SHARE * reachable)
