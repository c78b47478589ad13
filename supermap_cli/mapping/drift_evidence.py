"""How far the map may correct the odometry: both err, and the recording itself shows by how much.

Neither a robot's odometry nor the registration of its surfaces says how exact it is. So several hypotheses are kept: an
odometry whose shift and whose heading err by so many times the usual, from not at all to several times, whose single
poses jitter or not, and a registration that errs by so many times its own. Each is a Kalman filter of the correction,
each is judged by how well it foretold what registration found, and the correction is their mean, weighted by how likely
they are: multiple-model estimation (Magill 1965; Bar-Shalom, Li and Kirubarajan 2001, section 11.6). Where odometry
errs by less than registration can tell, that of an exact odometry wins, and next to nothing is corrected.

Registration tells where a keyframe stands to those whose surfaces it lies on, and these stand no better than they did
then. Only what the odometry has added since is weighed against it, and a keyframe is never better known than these.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from supermap_cli.geometry.arrays import Float32Array, FloatArray, IntArray
from supermap_cli.types.parameters import parameter

_FIRST_CAPACITY = 64
"""Keyframes for which there is room at first; a full array doubles."""

_UPPER = np.triu_indices(4)
_LEAST_INFORMATION = 1e-6
"""1/m^2, 1/rad^2: registration is taken to know every direction to a kilometre, so that no matrix is singular."""


@dataclass(frozen=True)
class DriftEvidenceParameters:
    """The hypotheses, all of them equally likely at first, what registration errs by, and how fast evidence comes."""

    odometry_times: tuple[float, ...] = parameter(
        (0.0, 0.25, 1.0, 4.0),
        "1",
        "by how many times the usual the odometry may err in shift, and in heading: `odometry_*` of drift",
        "from none, over LiDAR-inertial odometry (0.3 % of the way), to slipping wheels (10 %)",
    )
    registration_times: tuple[float, ...] = parameter(
        (0.5, 2.0),
        "1",
        "by how many times the usual registration may err: `surface_sigma_m` of drift",
        "from a LiDAR's centimetre to a stereo camera's four",
        at_least=0.01,
    )
    jitter_m: float = parameter(
        0.01, "m", "noise of each single pose, of an odometry that jitters", "a localisation by markers or scans"
    )
    jitter_deg: float = parameter(0.25, "deg", "the same of its heading", "jitter_m at a range of some two metres")
    calibration_m_per_m: float = parameter(
        0.005,
        "m/m",
        "what registration errs by for each metre between the two views",
        "depth cameras and their mountings: scale to half a percent, direction to a third of a degree",
    )
    independent_m: float = parameter(
        0.5, "m", "way of the camera after which registration errs anew", "tenth of compare_range_m", at_least=0.001
    )
    independent_deg: float = parameter(
        30.0, "deg", "turn of the camera after which it does", "half of what a usual camera sees", at_least=0.1
    )

    def independent_share(self, way_m: float, turned_deg: float) -> float:
        """Which share of a view of the same surfaces is evidence that the last one was not."""
        return min(1.0, way_m / self.independent_m + turned_deg / self.independent_deg)


DEFAULT = DriftEvidenceParameters()


@dataclass(frozen=True)
class KeyframePlace:
    """Where a correction is spoken of: the base as the odometry has it, and in the map, and the camera there, (3,)."""

    base_drifted: FloatArray
    base_map: FloatArray
    camera_map: FloatArray


@dataclass(frozen=True)
class SurfaceFit:
    """What registration says of a keyframe: about the correction `T_map_drifted` (4, 4) its misfit has the slope (4,)
    and the curvature `information` (4, 4) in x, y, z and heading of the base. The surfaces that it lies on were seen in
    the keyframes `sources` (k,), by `shares` (k,).
    """

    T_map_drifted: FloatArray
    slope: FloatArray
    information: FloatArray
    sources: IntArray
    shares: FloatArray


@dataclass(frozen=True)
class DriftBelief:
    """What m hypotheses take for the correction, and how likely they are.

    A correction is four numbers, where it takes the origin and its heading: of the walk, `drifts` (m, 4), and of the
    last pose with its jitter, `poses` (m, 4); covariances (m, 4, 4) are of errors about the map's origin.
    """

    drifts: FloatArray
    drift_covariances: FloatArray
    poses: FloatArray
    pose_covariances: FloatArray
    log_likelihoods: FloatArray

    @property
    def weights(self) -> FloatArray:
        """(m,) how likely each is."""
        likelihood: FloatArray = np.exp(self.log_likelihoods - self.log_likelihoods.max())
        likelihood /= likelihood.sum()
        return likelihood


class PastBeliefs:
    """What was believed of each keyframe when its surfaces were taken in, where the camera was, and what was applied:
    in arrays with room to grow. `beliefs` (k, m, 14) holds the pose and the upper triangle of its covariance.
    """

    def __init__(self, hypotheses: int) -> None:
        self._beliefs: Float32Array = np.zeros((_FIRST_CAPACITY, hypotheses, 14), np.float32)
        self._applied, self._cameras = np.zeros((_FIRST_CAPACITY, 4)), np.zeros((_FIRST_CAPACITY, 3))
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def first(self, count: int) -> tuple[Float32Array, FloatArray, FloatArray]:
        """The first `count` of them, as `PastBeliefs.restore` takes them."""
        return self._beliefs[:count], self._applied[:count], self._cameras[:count]

    def restore(self, beliefs: Float32Array, applied: FloatArray, cameras: FloatArray) -> None:
        """Know these, and no others."""
        self._beliefs, self._applied, self._cameras, self._count = beliefs, applied, cameras, len(applied)

    def add(self, poses: FloatArray, covariances: FloatArray, applied: FloatArray, camera_map: FloatArray) -> int:
        """Add a keyframe; returns its number."""
        number = self._count
        if number == len(self._applied):
            room = max(number, _FIRST_CAPACITY)
            self._beliefs = np.concatenate([self._beliefs, np.zeros((room, *self._beliefs.shape[1:]), np.float32)])
            self._applied = np.concatenate([self._applied, np.zeros((room, 4))])
            self._cameras = np.concatenate([self._cameras, np.zeros((room, 3))])
        self._beliefs[number, :, :4], self._beliefs[number, :, 4:] = poses, covariances[:, _UPPER[0], _UPPER[1]]
        self._applied[number], self._cameras[number] = applied, camera_map
        self._count = number + 1
        return number

    def of_met(self, found: SurfaceFit) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The mean belief (m, 4) and covariance (m, 4, 4) of the keyframes whose surfaces were met, and the mean
        correction (4,) that these were taken in with: they are all but alike.
        """
        met = self._beliefs[found.sources].reshape(len(found.sources), -1)
        mean = (found.shares.astype(np.float32) @ met).reshape(self._beliefs.shape[1:]).astype(np.float64)
        covariances = np.zeros((len(mean), 4, 4))
        covariances[:, _UPPER[0], _UPPER[1]] = covariances[:, _UPPER[1], _UPPER[0]] = mean[:, 4:]
        return mean[:, :4], covariances, found.shares @ self._applied[found.sources]

    def apart_m2(self, found: SurfaceFit, place: KeyframePlace) -> float:
        """Square metres; the mean squared distance between this view and those."""
        return float(found.shares @ np.square(self._cameras[found.sources] - place.camera_map).sum(axis=1))


class DriftEvidence:
    """The hypotheses, what they believe now, and what they believed of earlier keyframes."""

    def __init__(self, parameters: DriftEvidenceParameters = DEFAULT) -> None:
        self.parameters = parameters
        times = parameters.odometry_times
        kinds = np.stack(np.meshgrid(times, times, parameters.registration_times, (0.0, 1.0)), axis=-1).reshape(-1, 4)
        self._odometry, self._variance = kinds[:, [0, 0, 0, 1]], np.square(kinds[:, 2])
        sigmas = [parameters.jitter_m] * 3 + [float(np.radians(parameters.jitter_deg))]
        self._jitter = np.square(kinds[:, 3])[:, None, None] * np.diag(np.square(sigmas))
        nothing, exact = np.zeros((len(kinds), 4)), np.zeros((len(kinds), 4, 4))
        self.belief = DriftBelief(nothing, exact, nothing, exact, np.zeros(len(kinds)))
        self.past = PastBeliefs(len(kinds))

    def placed(self, covariance: FloatArray, base_map: FloatArray) -> None:
        """The base may be elsewhere than it is held to be, whatever the odometry: (4, 4) in x, y, z and heading."""
        self._grow(np.broadcast_to(covariance, self._jitter.shape), base_map)

    def moved(self, covariance: FloatArray, base_map: FloatArray) -> None:
        """The odometry has gone on; (4, 4) is what it usually errs by meanwhile."""
        self._grow(self._odometry[:, :, None] * covariance * self._odometry[:, None, :], base_map)

    def _grow(self, by: FloatArray, base_map: FloatArray) -> None:
        belief, to_origin = self.belief, _lever(base_map)
        covariances = belief.drift_covariances + to_origin @ by @ to_origin.T
        jitter = to_origin @ self._jitter @ to_origin.T
        self.belief = DriftBelief(
            belief.drifts, covariances, belief.drifts, covariances + jitter, belief.log_likelihoods
        )

    def weigh(self, found: SurfaceFit, place: KeyframePlace, share: float) -> None:
        """Take in what registration has found; `share` of it is evidence for or against hypotheses."""
        belief, to_origin, to_base = self.belief, _lever(place.base_map), _lever(-place.base_map)
        then, past, applied = self.past.of_met(found)
        drift = _not_negative(to_base @ (belief.drift_covariances - past) @ to_base.T)
        pose = drift + self._jitter
        predicted = _taken(belief.drifts, place.base_drifted)
        misplaced = _taken(then, place.base_drifted) - _taken(applied, place.base_drifted)
        at = _taken(numbers_of(found.T_map_drifted), place.base_drifted) + misplaced
        data = found.information + _LEAST_INFORMATION * np.eye(4)
        surprise = at - predicted - np.linalg.solve(data, found.slope)
        surprise[:, 3] = (surprise[:, 3] + np.pi) % (2 * np.pi) - np.pi
        miscalibrated = self.parameters.calibration_m_per_m**2 * self.past.apart_m2(found, place)
        noise = np.linalg.inv(data) + np.diag([miscalibrated] * 3 + [0.0])
        precision = np.linalg.inv(pose + self._variance[:, None, None] * noise)
        pull = precision @ surprise[:, :, None]
        likelihoods = (np.log(np.linalg.det(precision)) - (surprise * pull[:, :, 0]).sum(axis=1)) / 2
        self.belief = DriftBelief(
            _from_taken(predicted + (drift @ pull)[:, :, 0], place.base_drifted),
            past + to_origin @ _symmetric(drift - drift @ precision @ drift) @ to_origin.T,
            _from_taken(predicted + (pose @ pull)[:, :, 0], place.base_drifted),
            past + to_origin @ _symmetric(pose - pose @ precision @ pose) @ to_origin.T,
            belief.log_likelihoods + share * likelihoods,
        )

    def mean(self, base_drifted: FloatArray) -> FloatArray:
        """(4, 4) the likeliest `T_map_drifted` for a base there."""
        uncorrected = np.array([*base_drifted, 0.0])
        change = self.belief.weights @ (_taken(self.belief.poses, base_drifted) - uncorrected)
        mean = _from_taken(uncorrected + change, base_drifted) if change.any() else np.zeros(4)
        cos, sin = np.cos(mean[3]), np.sin(mean[3])
        return np.array([[cos, -sin, 0, mean[0]], [sin, cos, 0, mean[1]], [0, 0, 1, mean[2]], [0, 0, 0, 1]])

    def covariance(self, place: KeyframePlace) -> FloatArray:
        """(4, 4) how far, in x, y, z and heading, the base may be from its mean."""
        belief, weights, to_base = self.belief, self.belief.weights, _lever(-place.base_map)
        taken = _taken(belief.poses, place.base_drifted)
        spread = taken - weights @ taken
        within = to_base @ np.tensordot(weights, belief.pose_covariances, 1) @ to_base.T
        return np.asarray(within + (spread * weights[:, None]).T @ spread, np.float64)

    def remember(self, T_map_drifted: FloatArray, camera_map: FloatArray) -> int:
        """The last keyframe's surfaces are taken in with a correction; returns the number by which they go."""
        belief = self.belief
        return self.past.add(belief.poses, belief.pose_covariances, numbers_of(T_map_drifted), camera_map)

    def remember_exact(self, camera_map: FloatArray) -> int:
        """The same for surfaces of an earlier traversal, which the map's frame is told by."""
        belief = self.belief
        nothing = np.zeros(4)
        return self.past.add(np.zeros_like(belief.poses), np.zeros_like(self._jitter), nothing, camera_map)


def numbers_of(T: FloatArray) -> FloatArray:
    """(4,) where a level transform takes the origin, and its heading."""
    return np.array([*T[:3, 3], np.arctan2(T[1, 0], T[0, 0])])


def _taken(numbers: FloatArray, point: FloatArray) -> FloatArray:
    """Where corrections (..., 4) take a point (3,), and their headings."""
    cos, sin = np.cos(numbers[..., 3]), np.sin(numbers[..., 3])
    taken = numbers.copy()
    taken[..., 0] += cos * point[0] - sin * point[1]
    taken[..., 1] += sin * point[0] + cos * point[1]
    taken[..., 2] += point[2]
    return taken


def _from_taken(taken: FloatArray, point: FloatArray) -> FloatArray:
    """The inverse of `_taken`."""
    turned = np.zeros_like(taken)
    turned[..., 3] = taken[..., 3]
    numbers: FloatArray = taken - _taken(turned, point)
    numbers[..., 3] = taken[..., 3]
    return numbers


def _lever(place: FloatArray) -> FloatArray:
    """(4, 4) what an error about a place does at the origin."""
    lever = np.eye(4)
    lever[:2, 3] = place[1], -place[0]
    return lever


def _symmetric(matrices: FloatArray) -> FloatArray:
    return np.asarray((matrices + np.swapaxes(matrices, 1, 2)) / 2, np.float64)


def _not_negative(matrices: FloatArray) -> FloatArray:
    """The nearest symmetric matrices (m, 4, 4) without negative eigenvalues."""
    values, vectors = np.linalg.eigh(_symmetric(matrices))
    return np.asarray((vectors * np.maximum(values, 0)[:, None]) @ np.swapaxes(vectors, 1, 2), np.float64)
