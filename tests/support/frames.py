"""Small synthetic camera frames, and the frames of the real recording where it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.types.sensing import CameraFrame

SHARED = Path(__file__).resolve().parents[3] / "shared"
CAMERA = PinholeCamera(160, 120, 150.0, 150.0, 79.5, 59.5)


def shared_file(name: str) -> Path:
    """A file of the test material, or a skipped test."""
    path = SHARED / name
    if not path.is_file():
        pytest.skip(f"the test material has no {name}")
    return path


def frame(
    rgb: NDArray[np.uint8] | None = None,
    depth_m: NDArray[np.float32] | None = None,
    stamp_ns: int = 1,
    camera: PinholeCamera = CAMERA,
) -> CameraFrame:
    """A frame at the origin; grey, if no image is given."""
    image = np.full((camera.height, camera.width, 3), 128, np.uint8) if rgb is None else rgb
    return CameraFrame(stamp_ns, "camera_optical_frame", image, depth_m, camera, np.eye(4))
