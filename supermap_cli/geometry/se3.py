"""Rigid motions as 4x4 matrices `T_target_source`: p_target = T_target_source p_source (REP-103 axes, metres)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from supermap_cli.geometry.arrays import FloatArray

_IDENTITY = np.eye(4)


def check_transform(name: str, T: FloatArray) -> None:
    """Raise `ValueError` unless `T` is a finite (4, 4) rigid motion."""
    if T.shape != (4, 4):
        raise ValueError(f"{name}: expected shape (4, 4), got {T.shape}")
    if not np.isfinite(T).all():
        raise ValueError(f"{name}: holds NaN or infinity")
    R = T[:3, :3]
    if np.abs(R @ R.T - _IDENTITY[:3, :3]).max() > 1e-4 or np.linalg.det(R) < 0:
        raise ValueError(f"{name}: its rotation is not orthonormal")


def make_transform(R: ArrayLike, t: ArrayLike) -> FloatArray:
    """Build a transform from a rotation (3, 3) and a translation (3,)."""
    T = _IDENTITY.copy()
    T[:3, :3] = R
    T[:3, 3] = t
    return T


def inverse(T: FloatArray) -> FloatArray:
    """The inverse motion: `inverse(T_a_b)` is `T_b_a`."""
    R_t = T[:3, :3].T
    return make_transform(R_t, -R_t @ T[:3, 3])


def transform_points(T_target_source: FloatArray, points_source: NDArray[np.floating]) -> FloatArray:
    """Move (n, 3) points from the source to the target frame."""
    return points_source @ T_target_source[:3, :3].T + T_target_source[:3, 3]


def rotation_from_quaternion_xyzw(q_xyzw: ArrayLike) -> FloatArray:
    """Rotation (3, 3) of a quaternion (x, y, z, w); it is normalised first. Raises `ValueError` for a zero or non-
    finite one.
    """
    q = np.asarray(q_xyzw, dtype=np.float64)
    norm = float(np.linalg.norm(q))
    if not np.isfinite(norm) or norm < 1e-9:
        raise ValueError(f"not a quaternion: {q.tolist()}")
    x, y, z, w = q / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quaternion_xyzw_from_rotation(R: FloatArray) -> FloatArray:
    """Unit quaternion (x, y, z, w), w >= 0, of a rotation (3, 3)."""
    m00, m11, m22 = R[0, 0], R[1, 1], R[2, 2]
    candidates = np.array([1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22, 1 + m00 + m11 + m22])
    largest = int(np.argmax(candidates))
    s = 2.0 * np.sqrt(candidates[largest])
    a, b, c = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    d, e, f = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    rows = (
        (s / 4, d / s, e / s, a / s),
        (d / s, s / 4, f / s, b / s),
        (e / s, f / s, s / 4, c / s),
        (a / s, b / s, c / s, s / 4),
    )
    q = np.array(rows[largest])
    return -q if q[3] < 0 else q


def slerp_xyzw(q_start_xyzw: FloatArray, q_end_xyzw: FloatArray, fraction: float) -> FloatArray:
    """Spherical linear interpolation along the shorter arc (Shoemake 1985); `fraction` in [0, 1]."""
    dot = float(q_start_xyzw @ q_end_xyzw)
    q_end = q_end_xyzw if dot >= 0 else -q_end_xyzw
    dot = min(abs(dot), 1.0)
    if dot > 1 - 1e-9:
        q = (1 - fraction) * q_start_xyzw + fraction * q_end
    else:
        angle = np.arccos(dot)
        q = (np.sin((1 - fraction) * angle) * q_start_xyzw + np.sin(fraction * angle) * q_end) / np.sin(angle)
    normalised: FloatArray = q / np.linalg.norm(q)
    return normalised


def interpolate_transform(T_start: FloatArray, T_end: FloatArray, fraction: float) -> FloatArray:
    """Interpolate a motion: the rotation by SLERP, the translation linearly."""
    q = slerp_xyzw(
        quaternion_xyzw_from_rotation(T_start[:3, :3]), quaternion_xyzw_from_rotation(T_end[:3, :3]), fraction
    )
    t = (1 - fraction) * T_start[:3, 3] + fraction * T_end[:3, 3]
    return make_transform(rotation_from_quaternion_xyzw(q), t)


def rotation_angle_rad(R: FloatArray) -> float:
    """The angle in [0, pi] by which a rotation (3, 3) turns."""
    return float(np.arccos(np.clip((np.trace(R) - 1) / 2, -1.0, 1.0)))


def rotation_between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """The smallest rotation (3, 3) that turns direction `a` into direction `b` (Rodrigues)."""
    u = np.asarray(a, np.float64) / np.linalg.norm(a)
    v = np.asarray(b, np.float64) / np.linalg.norm(b)
    if u @ v >= 0:
        return _rotation_within_right_angle(u, v)
    axis = np.cross(u, v)
    if np.linalg.norm(axis) < 1e-6:
        axis = np.cross(u, [1.0, 0, 0] if abs(u[0]) < 0.9 else [0, 1.0, 0])
    axis -= (axis @ u) * u
    axis /= np.linalg.norm(axis)
    half_turn = 2 * np.outer(axis, axis) - np.eye(3)
    return _rotation_within_right_angle(-u, v) @ half_turn


def _rotation_within_right_angle(u: FloatArray, v: FloatArray) -> FloatArray:
    """Rodrigues' formula for unit vectors (3,) with u . v >= 0, where it is well conditioned."""
    axis = np.cross(u, v)
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    R: FloatArray = np.eye(3) + K + K @ K / (1 + u @ v)
    return R
