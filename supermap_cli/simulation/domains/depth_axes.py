"""How a depth camera measures, and when."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from supermap_cli.simulation.domains.domain import Axis, Level, usual_level
from supermap_cli.simulation.domains.rig_levels import rig_level
from supermap_cli.simulation.rigs import DepthSensor

TIME_OF_FLIGHT = DepthSensor(
    noise_per_m=0.0008,
    noise_m=0.004,
    nearest_m=0.5,
    farthest_m=5.46,
    edge_px=2,
    edge_holes=0.25,
    edge_mixed=0.6,
    multipath_share=0.006,
)
"""As Azure Kinect's (narrow, binned; data sheet: 0.5 to 5.46 m, random error at most 17 mm, systematic at most 11 mm +
0.1 %, more with multipath): where a pixel sees two surfaces it returns their mean.
"""

STEREO = DepthSensor(
    noise_per_m=0.004,
    noise_px=5,
    nearest_m=0.3,
    farthest_m=8.0,
    edge_px=3,
    edge_holes=0.5,
    edge_mixed=0.2,
    lost_share=0.01,
    blind_patches=True,
)
"""As RealSense D435's (data sheet: off by at most 2 % at 2 m, baseline 50 mm): 0.08 px of disparity at 640 pixels and
69 degrees are 3.4 mm at 1 m. Neighbouring pixels share a matching window, and so their error.
"""


def _sensor(text: str, change: Callable[[DepthSensor], DepthSensor]) -> Level:
    return rig_level(text, lambda rig: rig if rig.depth is None else replace(rig, depth=change(rig.depth)))


def _reach(farthest_m: float, text: str) -> Level:
    return _sensor(f"nothing beyond {farthest_m:g} m{text}", lambda sensor: replace(sensor, farthest_m=farthest_m))


def _delay(milliseconds: int) -> Level:
    text = f"depth is taken {milliseconds} ms after colour"
    return rig_level(text, lambda rig: rig if rig.depth is None else replace(rig, depth_delay_s=milliseconds / 1000))


DEPTH = Axis(
    "depth",
    "the depth camera, where there is one",
    "usual",
    {
        "usual": usual_level("noise of 1.5 mm at 1 m that grows with the square, up to 8 m, holes at edges"),
        "time-of-flight": _sensor(
            "noise of 4 mm, 0.6 % too far in patches, flying pixels at edges, up to 5.5 m", lambda _: TIME_OF_FLIGHT
        ),
        "stereo": _sensor(
            "noise of 4 mm at 1 m that grows with the square, patches without return, ragged edges", lambda _: STEREO
        ),
        "reach-3.5": _reach(3.5, ", as Structure and Xtion"),
        "reach-6": _reach(6.0, ""),
        "reach-10": _reach(10.0, ""),
        "flicker": _sensor(
            "3 pixels beside each edge jump between near and far, another way in every image",
            lambda sensor: replace(sensor, edge_px=3, edge_holes=0.1, edge_mixed=0.05, flicker=True),
        ),
    },
)

SYNC = Axis(
    "sync",
    "time between colour and depth",
    "0ms",
    {"0ms": usual_level("colour and depth are taken at once"), "5ms": _delay(5), "20ms": _delay(20)},
)
"""Cameras without a common trigger are apart by up to half a frame: 17 ms at 30 Hz. Each image has its own stamp."""
