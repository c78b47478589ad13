"""A layout for Foxglove that shows an exported map: 3D, the changes as a log, and the raw scene beside it."""

from __future__ import annotations

import json

from supermap_cli.exporting.ros.messages import FRAME
from supermap_cli.exporting.ros.recording import BASE, CHANGES, MARKERS, PATH, SCENE

SUFFIX = ".layout.json"
_SCENE_PANEL, _LOG_PANEL, _RAW_PANEL = "3D!map", "RosOut!changes", "RawMessages!scene"


def layout_json() -> str:
    """The text of the file: Foxglove, menu Layouts, "Import from file"."""
    view = {"distance": 14, "phi": 45, "thetaOffset": 45, "targetOffset": [0, 0, 0], "target": [0, 0, 0]}
    scene = {
        "followTf": FRAME,
        "followMode": "follow-none",
        "scene": {"enableStats": False, "transforms": {"showLabel": True}},
        "cameraState": {
            **view,
            "perspective": True,
            "fovy": 45,
            "near": 0.1,
            "far": 5000,
            "targetOrientation": [0, 0, 0, 1],
        },
        "transforms": {f"frame:{BASE}": {"visible": True}},
        "topics": {
            SCENE: {"visible": True},
            MARKERS: {"visible": False},
            PATH: {"visible": True, "type": "line", "lineWidth": 0.03, "gradient": ["#5b8deff0", "#7c3aedf0"]},
        },
        "layers": {
            "grid": {"layerId": "foxglove.Grid", "frameId": FRAME, "size": 20, "divisions": 20, "visible": True}
        },
    }
    layout = {
        "configById": {
            _SCENE_PANEL: scene,
            _LOG_PANEL: {"topicToRender": CHANGES, "minLogLevel": 1, "searchTerms": []},
            _RAW_PANEL: {"topicPath": f"{SCENE}.entities[:]{{id}}"},
        },
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": {
            "first": _SCENE_PANEL,
            "second": {"first": _LOG_PANEL, "second": _RAW_PANEL, "direction": "column", "splitPercentage": 50},
            "direction": "row",
            "splitPercentage": 70,
        },
    }
    return json.dumps(layout, indent=2) + "\n"
