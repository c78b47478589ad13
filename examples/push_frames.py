"""Numpy arrays in, a map out: a camera slides past a box before a wall. Run: python examples/push_frames.py map.db"""

import sys

import numpy as np

from supermap_cli.drivers.backends import session_backends
from supermap_cli.drivers.traversal_writer import TraversalWriter
from supermap_cli.geometry.cameras import PinholeCamera
from supermap_cli.memory import open_store
from supermap_cli.plugin_manager import load_plugins
from supermap_cli.types.detections import Detections, Hypothesis, cut_mask
from supermap_cli.types.sensing import CameraFrame, StampedPose

WIDTH, HEIGHT, FOCAL = 320, 240, 260.0
T_BASE_CAMERA = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.0], [0, 0, 0, 1]], float)  # z forward, 1 m up
U, V = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
X, Y = (U - WIDTH / 2) / FOCAL, (V - HEIGHT / 2) / FOCAL  # rays: depth z, right z X, down z Y


def look(y: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Colour, depth (m) and the box's mask as seen from a base at (0, y): floor, a wall at x = 4, a box at x = 2."""
    depth = np.minimum(4.0, np.where(Y > 0, 1.0 / np.maximum(Y, 1e-9), np.inf))
    box = (np.abs(2 * X - y) < 0.3) & (np.abs(2 * Y - 0.7) < 0.3)
    depth = np.where(box, 2.0, depth).astype(np.float32)
    return np.where(box[..., None], (200, 40, 40), (90, 90, 90)).astype(np.uint8), depth, box


def main(path: str) -> None:
    camera = PinholeCamera(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2)
    with open_store(path, create=True) as store, TraversalWriter(store, "slide") as writer:
        session = writer.open_session(session_backends(load_plugins()))
        for i, y in enumerate(np.linspace(-0.6, 0.6, 25)):
            stamp_ns = 1_700_000_000_000_000_000 + i * 333_000_000
            T_odom_base = np.eye(4)
            T_odom_base[1, 3] = y
            rgb, depth_m, box = look(y)
            session.add_pose(StampedPose(stamp_ns, T_odom_base))
            session.add_frame(CameraFrame(stamp_ns, "camera", rgb, depth_m, camera, T_BASE_CAMERA))
            u, v = U[box], V[box]
            xyxy = np.array([[u.min(), v.min(), u.max(), v.max()]], np.float32)
            label, score = ((Hypothesis("suitcase", 0.9),),), np.array([0.9], np.float32)
            session.add_detections(Detections(stamp_ns, xyxy, score, label, (cut_mask(box),)))
            writer.write(session.step())
        writer.write(session.close())
        writer.finish()


if __name__ == "__main__":
    main(sys.argv[1])
