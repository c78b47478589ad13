"""The objects of the map while it is being built: the paper's O, with voxels in the place of points."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

from supermap_cli.geometry.arrays import BoolArray, FloatArray
from supermap_cli.mapping import belief, class_sizes, motion, object_shape, relief, voxel_map
from supermap_cli.mapping.absence import AbsenceEvidence
from supermap_cli.mapping.belief import BeliefParameters, Existence, LabelBelief, ViewpointHistory
from supermap_cli.mapping.bounds import BoundsIndex
from supermap_cli.mapping.class_sizes import ClassSizeParameters
from supermap_cli.mapping.motion import MotionParameters, MotionState
from supermap_cli.mapping.object_shape import ObjectShape, ObjectShapeParameters, measure_shape
from supermap_cli.mapping.recall import FoundBy
from supermap_cli.mapping.relief import ReliefLooks, ReliefParameters
from supermap_cli.mapping.voxel_map import VoxelMap, VoxelMapParameters
from supermap_cli.types import existence
from supermap_cli.types.existence import ExistenceParameters, probability_of
from supermap_cli.types.labels import DYNAMIC_CLASSES
from supermap_cli.types.memory import Observation


@dataclass(frozen=True)
class ObjectParameterSets:
    """The parameters of all that an object holds."""

    object_shape: ObjectShapeParameters = object_shape.DEFAULT
    belief: BeliefParameters = belief.DEFAULT
    class_sizes: ClassSizeParameters = class_sizes.DEFAULT
    motion: MotionParameters = motion.DEFAULT
    voxel_map: VoxelMapParameters = voxel_map.DEFAULT
    existence: ExistenceParameters = existence.DEFAULT
    relief: ReliefParameters = relief.DEFAULT


DEFAULT_SETS = ObjectParameterSets()


@dataclass
class OpenState:
    """The state an object is in now: since when, and when its place was last seen empty before."""

    index: int
    first_seen_ns: int
    empty_before_ns: int | None = None


@dataclass(frozen=True)
class ObjectStatus:
    """How far an object has come: `confirmed` (in the map, else tentative), `stored` (known to the memory), `demoted`
    (confirmed once, but believed in no more), `present`, or absent since `gone_ns`.
    """

    confirmed: bool = False
    stored: bool = False
    demoted: bool = False
    present: bool = True
    gone_ns: int | None = None


@dataclass
class VisitCount:
    """In how many keyframes the running traversal supported an object, had its place in view, and saw its place empty.

    `in_view_at_support` is how often it had been in view when it was last supported; `earlier_ns` when an earlier
    traversal saw it last.
    """

    supported: int = 0
    in_view: int = 0
    contradicted: int = 0
    in_view_at_support: int = 0
    first_support_ns: int | None = None
    last_support_ns: int | None = None
    last_support_camera: str | None = None
    earlier_ns: int | None = None

    def add_support(self, stamp_ns: int, camera_id: str) -> None:
        """Count a keyframe that supports the object, once however many detections it holds of it; the keyframes of
        several cameras at one moment are several.
        """
        if (self.last_support_ns, self.last_support_camera) == (stamp_ns, camera_id):
            return
        self.supported += 1
        self.in_view += 1
        self.in_view_at_support = self.in_view
        self.first_support_ns = stamp_ns if self.first_support_ns is None else self.first_support_ns
        self.last_support_ns, self.last_support_camera = stamp_ns, camera_id


@dataclass
class DisplacementEvidence:
    """What the last detections say of an object that stands beside its place.

    Those at `views` moments in a row, of so many `keyframes`, showed it there, from `first_ns` to `last_ns`, the last
    by the shift `shift_m` (3,), if that is known, all together with `gain` (`displacement.agreement`).
    """

    views: int = 0
    keyframes: int = 0
    first_ns: int = 0
    last_ns: int = 0
    shift_m: FloatArray | None = None
    gain: float = 0.0

    def interrupt(self) -> None:
        """What is counted in a row begins anew."""
        self.views = self.keyframes = 0


@dataclass
class MissEvidence:
    """What the views since an object was last detected say against it (`log_odds`), the first at `first_ns`.

    `unsettled` are those of them (visible share of the image, truncated) that were misses only if it is still there.
    """

    log_odds: float = 0.0
    first_ns: int = 0
    viewpoints: ViewpointHistory = field(default_factory=ViewpointHistory)
    unsettled: list[tuple[float, bool]] = field(default_factory=list)


@dataclass
class MapObject:
    """One thing the map believes in, or is about to.

    It was seen from `first_seen_ns` to `last_seen_ns`, `observations` times; `pending` are the observations made before
    it was confirmed. `track_ids` are its tracks by camera, for each camera has a tracker of its own. `best_crop` is how
    good the best picture is that was kept of it in this traversal and place. `seen_apart` says of other objects, by
    number, how many images of all traversals have shown each of the two with a mask of its own. `found_by` says of each
    detector, by its identity, how often it found the object, `relief` of each label how often it stood out like one.
    """

    number: int
    voxels: VoxelMap
    labels: LabelBelief
    existence: Existence
    state: OpenState
    first_seen_ns: int
    last_seen_ns: int
    observations: int = 0
    status: ObjectStatus = field(default_factory=ObjectStatus)
    pending: list[Observation] = field(default_factory=list)
    track_ids: dict[str, int] = field(default_factory=dict)
    absence: AbsenceEvidence = field(default_factory=AbsenceEvidence)
    displacement: DisplacementEvidence = field(default_factory=DisplacementEvidence)
    misses: MissEvidence = field(default_factory=MissEvidence)
    motion: MotionState = field(default_factory=MotionState)
    visit: VisitCount = field(default_factory=VisitCount)
    best_crop: float = 0.0
    seen_apart: dict[int, int] = field(default_factory=dict)
    found_by: dict[str, FoundBy] = field(default_factory=dict)
    relief: dict[str, ReliefLooks] = field(default_factory=dict)
    parameters: ObjectParameterSets = field(default=DEFAULT_SETS, repr=False)
    _shape: ObjectShape | None = field(default=None, repr=False)
    _changed: set[int] = field(default_factory=set, repr=False)

    @property
    def label(self) -> str:
        """The most likely label."""
        return self.labels.best

    @property
    def existence_log_odds(self) -> float:
        """That it is real: by what the detector said of it, and by whether it stands out like a thing so called.

        What relief says is no sum over views, and is worth as much more than these as they are too sure.
        """
        looks = self.relief.get(self.label)
        if looks is None:
            return self.existence.log_odds
        return self.existence.log_odds + looks.log_ratio(self.parameters.relief) / self.parameters.existence.slope

    @property
    def confidence(self) -> float:
        """The probability that it is right: real, in its place, and rightly called."""
        return probability_of(self.existence_log_odds, self.parameters.existence)

    @property
    def is_dynamic(self) -> bool:
        """Whether it moves by itself: it is called so, or as likely as not so that its moving decides."""
        return self.label in DYNAMIC_CLASSES or (self.state.index > 0 and self._may_be_dynamic)

    @property
    def _may_be_dynamic(self) -> bool:
        """Whether it may well be of a class that moves by itself."""
        probabilities = self.labels.probabilities()
        dynamic = sum(share for label, share in probabilities.items() if label in DYNAMIC_CLASSES)
        return dynamic > self.parameters.motion.dynamic_share

    @property
    def is_moving(self) -> bool:
        """Whether it is moving now, carried or by itself."""
        walking = self.motion.course is not None and self.motion.course.walking
        return self.motion.moving or (walking and self.is_dynamic)

    @property
    def confirmed(self) -> bool:
        """Whether it is in the map; else it is tentative."""
        return self.status.confirmed

    @property
    def present(self) -> bool:
        """Whether it stands in its place, as far as is known."""
        return self.status.present

    @property
    def demoted(self) -> bool:
        """Whether it was confirmed once, but is believed in no more."""
        return self.status.demoted

    @property
    def gone_ns(self) -> int | None:
        """Since when it has been seen to be gone."""
        return self.status.gone_ns

    @property
    def shape(self) -> ObjectShape:
        """Box, centroid and coarse occupancy, worked out anew when the voxels have changed."""
        if self._shape is None:
            self._shape = measure_shape(self.voxels, self.parameters.object_shape, self.parameters.voxel_map)
        return self._shape

    @property
    def solid(self) -> BoolArray:
        """(n,) which voxels are believed to be the object's, as of when its shape was measured."""
        return self.shape.solid

    def add_look(self, detector: str, look: FoundBy) -> None:
        """A detector has looked at the object."""
        self.found_by[detector] = self.found_by.get(detector, FoundBy()) + look

    def add_relief(self, label: str, looks: ReliefLooks) -> None:
        """It has been seen to be flat, or to stand out, for what it is called by this label."""
        self.relief[label] = self.relief.get(label, ReliefLooks()) + looks

    def set_status(
        self, *, confirmed: bool | None = None, stored: bool | None = None, demoted: bool | None = None
    ) -> None:
        """Change parts of the status; `None` leaves one as it is."""
        given = {"confirmed": confirmed, "stored": stored, "demoted": demoted}
        self.status = replace(self.status, **{name: value for name, value in given.items() if value is not None})

    def mark_absent(self, gone_ns: int | None) -> None:
        """It is gone since then, and no camera tracks it any more."""
        self.status = replace(self.status, present=False, gone_ns=gone_ns)
        self.track_ids = {}

    def mark_present(self) -> None:
        """It stands somewhere; what spoke for its having gone is void."""
        self.status = replace(self.status, present=True, gone_ns=None)
        self.clear_negative_evidence()

    def clear_negative_evidence(self) -> None:
        """It has been seen where it is believed to stand: what spoke for its having gone before is void."""
        self.absence = AbsenceEvidence()
        self.misses = MissEvidence(viewpoints=ViewpointHistory(parameters=self.parameters.belief))

    @property
    def measured(self) -> bool:
        """Whether its shape has been worked out since its voxels changed."""
        return self._shape is not None

    def voxels_changed(self, *, measured: bool = False) -> None:
        """Measure the shape anew when it is next needed, unless it was `measured` since, and notify the map."""
        if not measured:
            self._shape = None
        self._changed.add(self.number)

    def report_changes_to(self, changed: set[int]) -> None:
        """From now on, enter the object's number there whenever its voxels have changed."""
        self._changed = changed

    def use(self, parameters: ObjectParameterSets) -> None:
        """Set the parameters of all that the object holds."""
        if self.parameters is parameters:
            return
        self.parameters = parameters
        self.labels.parameters, self.labels.size_parameters = parameters.belief, parameters.class_sizes
        for viewpoints in (self.existence.viewpoints, self.misses.viewpoints):
            viewpoints.parameters = parameters.belief
        self.motion.parameters = parameters.motion
        if self.motion.course is not None:
            self.motion.course = replace(self.motion.course, parameters=parameters.motion)
        if self._shape is not None:
            self._shape = replace(self._shape, parameters=parameters.object_shape)


@dataclass
class ObjectMap:
    """All objects, tentative ones too, by number; numbers are never used twice. `detector` is the identity of the
    detector that looks at them now.
    """

    next_number: int = 1
    by_number: dict[int, MapObject] = field(default_factory=dict)
    parameters: ObjectParameterSets = field(default=DEFAULT_SETS, repr=False)
    detector: str = ""
    _bounds: BoundsIndex = field(default_factory=BoundsIndex, repr=False)

    def __iter__(self) -> Iterator[MapObject]:
        return iter(self.by_number.values())

    def __len__(self) -> int:
        return len(self.by_number)

    def __getitem__(self, number: int) -> MapObject:
        return self.by_number[number]

    def use(self, parameters: ObjectParameterSets) -> None:
        """Set the parameters of all objects, also of those that are added later."""
        self.parameters = parameters
        for obj in self:
            obj.use(parameters)

    def use_detector(self, detector: str) -> None:
        """From now on the words on all objects are this detector's."""
        self.detector = detector
        for obj in self:
            obj.labels.detector = detector

    def new_number(self) -> int:
        """The number of the next object."""
        self.next_number += 1
        return self.next_number - 1

    def add(self, added: MapObject) -> None:
        """Enter an object; it follows the map's parameters from now on."""
        added.use(self.parameters)
        added.labels.detector = self.detector
        self.by_number[added.number] = added
        self._bounds.add(added.number)
        added.report_changes_to(self._bounds.changed)

    def remove(self, number: int) -> None:
        """Forget an object."""
        self.by_number.pop(number).report_changes_to(set())
        self._bounds.remove(number)

    def bounds(self) -> BoundsIndex:
        """Where all objects are now."""
        self._bounds.refresh(lambda number: self.by_number[number].shape.bounds)
        return self._bounds

    def within(self, center: FloatArray, radius_m: float) -> list[MapObject]:
        """Objects whose bounds come within a distance of a point."""
        return [self.by_number[number] for number in self.bounds().within(center, radius_m)]

    def beside(self, numbers: Iterable[int], gap_m: float) -> list[tuple[MapObject, MapObject]]:
        """Pairs of objects, one of them among `numbers`, whose bounds lie closer than `gap_m` along every axis."""
        pairs = self.bounds().beside(numbers, gap_m)
        return [(self.by_number[first], self.by_number[second]) for first, second in pairs]
