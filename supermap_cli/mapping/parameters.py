"""All parameters of the mapping engine: one set for each file of `supermap_cli/mapping/`, under the file's name.

That of `supermap_cli/types/existence.py` is among them: readers of a map need it too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from supermap_cli.errors import ConfigError
from supermap_cli.mapping.absence import AbsenceParameters
from supermap_cli.mapping.alignment import AlignmentParameters, AlignmentParameterSets
from supermap_cli.mapping.association import AssociationParameters
from supermap_cli.mapping.belief import BeliefParameters
from supermap_cli.mapping.below_lidar_fov import BelowLidarFovParameters
from supermap_cli.mapping.class_sizes import ClassSizeParameters
from supermap_cli.mapping.clusters import ClusterParameters
from supermap_cli.mapping.crops import CropParameters
from supermap_cli.mapping.depth import DepthParameters
from supermap_cli.mapping.displacement import DisplacementParameters
from supermap_cli.mapping.drift import DriftParameters
from supermap_cli.mapping.drift_evidence import DriftEvidenceParameters
from supermap_cli.mapping.duplicates import DuplicatesParameters
from supermap_cli.mapping.floor_by_feet import FloorByFeetParameters
from supermap_cli.mapping.foreground import ForegroundParameters
from supermap_cli.mapping.free_space import FreeSpaceParameters
from supermap_cli.mapping.fusion import FusionParameters
from supermap_cli.mapping.icp import IcpParameters
from supermap_cli.mapping.keyframe_view import KeyframeViewParameters
from supermap_cli.mapping.levelling import LevellingParameters
from supermap_cli.mapping.lidar_foreground import LidarForegroundParameters
from supermap_cli.mapping.lidar_lifting import LidarLiftingParameters
from supermap_cli.mapping.lifecycle import LifecycleParameters
from supermap_cli.mapping.lifting import LiftingParameters, LiftingParameterSets
from supermap_cli.mapping.mask_core import MaskCoreParameters
from supermap_cli.mapping.mask_overlap import MaskOverlapParameters
from supermap_cli.mapping.missed_detections import MissedDetectionParameters
from supermap_cli.mapping.motion import MotionParameters
from supermap_cli.mapping.object_shape import ObjectShapeParameters
from supermap_cli.mapping.objects import ObjectParameterSets
from supermap_cli.mapping.pair_evidence import PairEvidenceParameters
from supermap_cli.mapping.place_search import PlaceSearchParameters
from supermap_cli.mapping.recall import RecallParameters
from supermap_cli.mapping.relief import ReliefParameters
from supermap_cli.mapping.relocation import RelocationParameters
from supermap_cli.mapping.returns import ReturnsParameters
from supermap_cli.mapping.seam import SeamParameters
from supermap_cli.mapping.splitting import SplittingParameters
from supermap_cli.mapping.structure import StructureParameters
from supermap_cli.mapping.visibility import VisibilityParameters
from supermap_cli.mapping.voxel_map import VoxelMapParameters
from supermap_cli.mapping.walls import WallParameters
from supermap_cli.types.existence import ExistenceParameters, probability_of
from supermap_cli.types.parameters import ParameterRow, described, overridden


@dataclass(frozen=True)
class MappingParameters:
    """The sets, each frozen, in the order of the method. A new file with numbers gets a line here."""

    levelling: LevellingParameters = field(default_factory=LevellingParameters)
    alignment: AlignmentParameters = field(default_factory=AlignmentParameters)
    place_search: PlaceSearchParameters = field(default_factory=PlaceSearchParameters)
    icp: IcpParameters = field(default_factory=IcpParameters)
    structure: StructureParameters = field(default_factory=StructureParameters)
    drift: DriftParameters = field(default_factory=DriftParameters)
    drift_evidence: DriftEvidenceParameters = field(default_factory=DriftEvidenceParameters)
    depth: DepthParameters = field(default_factory=DepthParameters)
    returns: ReturnsParameters = field(default_factory=ReturnsParameters)
    visibility: VisibilityParameters = field(default_factory=VisibilityParameters)
    keyframe_view: KeyframeViewParameters = field(default_factory=KeyframeViewParameters)
    seam: SeamParameters = field(default_factory=SeamParameters)
    mask_overlap: MaskOverlapParameters = field(default_factory=MaskOverlapParameters)
    foreground: ForegroundParameters = field(default_factory=ForegroundParameters)
    relief: ReliefParameters = field(default_factory=ReliefParameters)
    mask_core: MaskCoreParameters = field(default_factory=MaskCoreParameters)
    clusters: ClusterParameters = field(default_factory=ClusterParameters)
    lifting: LiftingParameters = field(default_factory=LiftingParameters)
    lidar_lifting: LidarLiftingParameters = field(default_factory=LidarLiftingParameters)
    lidar_foreground: LidarForegroundParameters = field(default_factory=LidarForegroundParameters)
    below_lidar_fov: BelowLidarFovParameters = field(default_factory=BelowLidarFovParameters)
    floor_by_feet: FloorByFeetParameters = field(default_factory=FloorByFeetParameters)
    voxel_map: VoxelMapParameters = field(default_factory=VoxelMapParameters)
    object_shape: ObjectShapeParameters = field(default_factory=ObjectShapeParameters)
    class_sizes: ClassSizeParameters = field(default_factory=ClassSizeParameters)
    belief: BeliefParameters = field(default_factory=BeliefParameters)
    existence: ExistenceParameters = field(default_factory=ExistenceParameters)
    association: AssociationParameters = field(default_factory=AssociationParameters)
    motion: MotionParameters = field(default_factory=MotionParameters)
    displacement: DisplacementParameters = field(default_factory=DisplacementParameters)
    fusion: FusionParameters = field(default_factory=FusionParameters)
    splitting: SplittingParameters = field(default_factory=SplittingParameters)
    pair_evidence: PairEvidenceParameters = field(default_factory=PairEvidenceParameters)
    recall: RecallParameters = field(default_factory=RecallParameters)
    absence: AbsenceParameters = field(default_factory=AbsenceParameters)
    missed_detections: MissedDetectionParameters = field(default_factory=MissedDetectionParameters)
    lifecycle: LifecycleParameters = field(default_factory=LifecycleParameters)
    relocation: RelocationParameters = field(default_factory=RelocationParameters)
    duplicates: DuplicatesParameters = field(default_factory=DuplicatesParameters)
    free_space: FreeSpaceParameters = field(default_factory=FreeSpaceParameters)
    crops: CropParameters = field(default_factory=CropParameters)
    walls: WallParameters = field(default_factory=WallParameters)

    @classmethod
    def from_overrides(cls, values: Mapping[str, Mapping[str, object]]) -> MappingParameters:
        """The defaults but for the given values, by file and name. Raises `ConfigError` naming a wrong entry."""
        parameters = overridden(cls(), values)
        greatest = probability_of(parameters.belief.max_existence, parameters.existence)
        if parameters.lifecycle.min_confidence > greatest:
            raise ConfigError(
                f"nothing would enter the map: min_confidence is {parameters.lifecycle.min_confidence:g}, and no "
                f"object can be surer than {greatest:.3f}",
                cure=f"choose less than {greatest:.2f}",
            )
        return parameters

    def describe(self) -> Iterator[ParameterRow]:
        """All parameters with unit, meaning and source."""
        return described(self)

    def lifting_sets(self) -> LiftingParameterSets:
        """What `lifting.lift` works with."""
        return LiftingParameterSets(
            self.lifting,
            self.foreground,
            self.mask_core,
            self.clusters,
            self.lidar_lifting,
            self.lidar_foreground,
            self.below_lidar_fov,
            self.relief,
            self.voxel_map.finest_voxel_m,
        )

    def alignment_sets(self) -> AlignmentParameterSets:
        """What `alignment.align` works with."""
        return AlignmentParameterSets(self.alignment, self.place_search, self.icp)

    def object_sets(self) -> ObjectParameterSets:
        """What an object holds."""
        return ObjectParameterSets(
            self.object_shape, self.belief, self.class_sizes, self.motion, self.voxel_map, self.existence, self.relief
        )
