"""All of the zoo, family by family.

To add a recording, write one `Variant` into a table in `families/`: a `Robot` with the topics, frames and encodings as
the driver's documentation has them (`source`). It must become a map of the suitcase with the topics that you named; or
name the line that refuses it (`refused`), or the options that mend it (`options`). Then run

    make zoo                    # pytest tests/zoo, and the table in docs/recordings.md
"""

from __future__ import annotations

from collections.abc import Mapping

from zoo.families import (
    detectors,
    encodings,
    kinect,
    lidars,
    oak,
    orbbec,
    realsense,
    recorders,
    rigs,
    robots,
    simulators,
    zed,
)
from zoo.robot import Variant

FAMILIES: Mapping[str, tuple[Variant, ...]] = {
    "RealSense": realsense.VARIANTS,
    "ZED": zed.VARIANTS,
    "OAK-D": oak.VARIANTS,
    "Kinect": kinect.VARIANTS,
    "Orbbec": orbbec.VARIANTS,
    "LiDAR": lidars.VARIANTS,
    "Robots": robots.VARIANTS,
    "Simulators": simulators.VARIANTS,
    "Images": encodings.VARIANTS,
    "Detections": detectors.VARIANTS,
    "Motion, frames, clocks": rigs.VARIANTS,
    "Files": recorders.VARIANTS,
}
"""Title of a family to its recordings."""
