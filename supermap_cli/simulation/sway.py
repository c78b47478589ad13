"""How a walking person sways what they carry: a smooth motion in all six degrees of freedom, known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import FloatArray

_STEPS_HZ = 1.8  # steps a second of a person who walks (Bohannon 1997: 1.7 to 2.0); from side to side half as often

# Of the sinusoids of each degree of freedom: the gait, and slower motions of the arms and of looking:
# (amplitude in degrees or m, Hz), chosen so that a carried camera turns by about 65 degrees/s.
_DEGREES: dict[str, tuple[tuple[float, float], ...]] = {
    "roll": ((2.5, _STEPS_HZ / 2), (2.0, 0.37)),
    "pitch": ((1.0, _STEPS_HZ), (5.0, 0.41)),
    "yaw": ((2.0, _STEPS_HZ / 2), (9.0, 0.29), (4.0, 0.61)),
}
_METRES: dict[str, tuple[tuple[float, float], ...]] = {
    "x": ((0.01, _STEPS_HZ), (0.02, 0.31)),
    "y": ((0.02, _STEPS_HZ / 2), (0.02, 0.23)),
    "z": ((0.02, _STEPS_HZ), (0.02, 0.19)),
}


@dataclass(frozen=True)
class Sway:
    """The motion of a base that is carried against one that stays level on the floor, about a point `pivot_m` above it:
    a sum of sinusoids, each with one of the `phases` (radians).
    """

    pivot_m: float
    phases: tuple[float, ...]

    @classmethod
    def drawn(cls, pivot_m: float, rng: np.random.Generator) -> Sway:
        """One of which every sinusoid begins anywhere."""
        sinusoids = sum(len(terms) for terms in (*_DEGREES.values(), *_METRES.values()))
        return cls(pivot_m, tuple(rng.uniform(0, 2 * np.pi, sinusoids).tolist()))

    def T_level_base(self, since_s: FloatArray) -> FloatArray:
        """(n, 4, 4) the swaying base in the level one, at seconds since the start."""
        from scipy.spatial.transform import Rotation  # noqa: PLC0415 - keeps start-up light

        phases = iter(self.phases)
        motions = [
            sum(
                (amplitude * np.sin(2 * np.pi * hz * since_s + next(phases)) for amplitude, hz in terms),
                start=np.zeros(len(since_s)),
            )
            for terms in (*_DEGREES.values(), *_METRES.values())
        ]
        roll, pitch, yaw = motions[:3]
        pivot = np.array([0.0, 0.0, self.pivot_m])
        T = np.tile(np.eye(4), (len(since_s), 1, 1))
        T[:, :3, :3] = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]), degrees=True).as_matrix()
        T[:, :3, 3] = pivot - T[:, :3, :3] @ pivot + np.column_stack(motions[3:])
        return T
