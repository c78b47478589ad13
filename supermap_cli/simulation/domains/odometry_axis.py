"""How far the robot's own odometry leaves the truth."""

from __future__ import annotations

from dataclasses import replace

from supermap_cli.simulation.domains.domain import Axis, Level, usual_level
from supermap_cli.simulation.domains.rig_levels import rig_level
from supermap_cli.simulation.rigs import OdometryDrift

_EXACT = OdometryDrift(position=0.0, yaw_deg=0.0, per_turn_deg=0.0, scale=0.0, jitter_m=0.0)

# In what proportion position (m per root metre), heading (degrees per root metre and turn) and scale err where a share
# of the way is asked for: at 1 % of some ten metres each gives a third of the error or so.
_ONE_PERCENT = OdometryDrift(position=0.012, yaw_deg=0.5, per_turn_deg=0.6, scale=0.008, jitter_m=0.001)


def _drift(text: str, drift: OdometryDrift) -> Level:
    return rig_level(text, lambda rig: replace(rig, drift=drift))


def _share(percent: float) -> Level:
    times = percent / 1.0
    drift = replace(
        _ONE_PERCENT,
        share=percent / 100,
        position=times * _ONE_PERCENT.position,
        yaw_deg=times * _ONE_PERCENT.yaw_deg,
        per_turn_deg=times * _ONE_PERCENT.per_turn_deg,
        scale=times * _ONE_PERCENT.scale,
    )
    return _drift(f"random walk and scale error: at the end off by {percent:g} % of the way", drift)


ODOMETRY = Axis(
    "odometry",
    "the robot's own odometry",
    "usual",
    {
        "usual": usual_level("random walk and scale error: a decimetre or two after sixty metres"),
        "perfect": _drift("exact", _EXACT),
        "jitter": _drift(
            "no drift; white noise of 1 cm and 0.3 degrees on every pose",
            replace(_EXACT, jitter_m=0.01, jitter_deg=0.3),
        ),
        "drift-0.5": _share(0.5),
        "drift-1": _share(1.0),
        "drift-3": _share(3.0),
        "jump": rig_level(
            "one jump of 0.3 m and 5 degrees half way or so, besides the usual drift",
            lambda rig: replace(rig, drift=replace(rig.drift, jump_m=0.3, jump_deg=5.0)),
        ),
        "yaw": _drift("heading alone errs, by 0.5 degrees a metre to one side", replace(_EXACT, turned_deg_per_m=0.5)),
    },
)
"""Visual-inertial odometry drifts by 0.5 to 1 % of the way (KITTI's odometry benchmark lists 0.5 to 1.5 % for cameras),
wheels by a few percent. A jump is what a localisation does that finds itself elsewhere.
"""
