"""Evidence of absence: views in a row that went through an object's place, or views of parts of it that add up.

Departs from the paper, which negates an object on one inconsistent depth image: one image has a pose, and errors.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from supermap_cli.geometry.arrays import BoolArray, IntArray
from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class AbsenceParameters:
    """What a view must show before an object's place counts as empty."""

    absent_share: float = parameter(
        0.6, "1", "share of what can be seen of a place above which it counts as looked through", TUNED, at_most=1.0
    )
    absent_views: int = parameter(
        3, "1", "moments at which it must have been so: images of one moment share the pose's error", TUNED, at_least=1
    )
    error_span_s: float = parameter(
        2.0,
        "s",
        "time that emptiness must span of an object that was found in its place less than that before: an error of the "
        "pose or between the clocks of colour and depth lasts for a turn of the camera",
        "as belief.error_duration_s",
    )
    observable_share: float = parameter(
        0.3,
        "1",
        "share of an object's voxels that an image must be able to speak of before a miss or emptiness counts",
        TUNED,
        at_most=1.0,
    )
    min_voxels: int = parameter(
        30, "1", "voxels looked through, fewer are those of a few rays, whose errors they share", TUNED
    )
    min_view_share: float = parameter(
        0.01, "1", "share of the voxels that a view must be able to speak of: less are strays and rims", TUNED
    )

    @property
    def empty_share(self) -> float:
        """Share of all voxels looked through, in views of parts, that means as much as a view of so much of the
        whole.
        """
        return self.absent_share * self.observable_share


DEFAULT = AbsenceParameters()


@dataclass
class EmptyRun:
    """Views of parts of an object's place since it has been found empty, and what they last said of each voxel.

    An object is there as a whole or is gone as a whole, from some time on. So a run begins with a view that goes
    through what it can see of the object, and was none once all that has been judged since no longer says that it went:
    a change point, as in a cumulative sum test (Page 1954). `codes` (n,) are the voxels it is about, `judged` and
    `through` (n,) those of which a view could speak, and those that the last such view went through; at `views` moments
    a part was found empty, first at `began_ns`, last at `last_ns`.
    """

    codes: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))
    judged: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    through: BoolArray = field(default_factory=lambda: np.zeros(0, bool))
    views: int = 0
    began_ns: int = 0
    last_ns: int = 0

    def add(
        self,
        codes: IntArray,
        judged: BoolArray,
        through: BoolArray,
        stamp_ns: int,
        parameters: AbsenceParameters = DEFAULT,
    ) -> None:
        """Add a view of the voxels `codes`, of which it judges (n,) some and goes `through` (n,) some of these; other
        voxels than before begin a new run.
        """
        if self.codes is not codes:
            self.views = 0
        judged_count = np.count_nonzero(judged)
        if judged_count <= parameters.min_view_share * len(codes):
            return
        emptied = np.count_nonzero(through) > parameters.absent_share * judged_count
        if self.views == 0:
            if not emptied:
                return
            self.codes, self.began_ns = codes, stamp_ns
            self.judged, self.through = np.zeros(len(codes), bool), np.zeros(len(codes), bool)
        if emptied:
            self.views += int(self.views == 0 or stamp_ns != self.last_ns)
            self.last_ns = stamp_ns
        self.judged |= judged
        self.through[judged] = through[judged]
        if np.count_nonzero(self.through) <= parameters.absent_share * np.count_nonzero(self.judged):
            self.end()

    def end(self) -> None:
        """The object was seen in its place: no view before says that it went."""
        self.views = 0

    def shows_absence(self, reachable: float, parameters: AbsenceParameters = DEFAULT) -> bool:
        """Whether so much of an object, of which rays can reach so many voxels, was seen through that it has gone."""
        through = int(np.count_nonzero(self.through))
        enough = max(parameters.min_voxels, parameters.empty_share * reachable)
        return self.views >= parameters.absent_views and through >= enough


@dataclass
class AbsenceEvidence:
    """What the views since an object was last seen in its place say of its having gone.

    At `views` moments in a row most of its place was looked through, first at `first_ns`, last at `last_ns`; `parts`
    adds up views of parts of it.
    """

    views: int = 0
    first_ns: int = 0
    last_ns: int = 0
    parts: EmptyRun = field(default_factory=EmptyRun)

    def add_empty(self, stamp_ns: int) -> None:
        """A view went through most of its place; several cameras' views of one moment are one."""
        if self.views > 0 and stamp_ns == self.last_ns:
            return
        self.views += 1
        self.last_ns = stamp_ns
        if self.views == 1:
            self.first_ns = stamp_ns

    def add_occupied(self) -> None:
        """A view found its place taken."""
        self.views = 0
        self.parts.end()
