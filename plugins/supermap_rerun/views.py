"""How the viewer is arranged, and the paths of entities."""

from __future__ import annotations

import rerun.blueprint as rrb

from supermap_cli.types.sensing import MAIN_CAMERA

TIMELINE = "map_time"
"""Sensor time of the map; that of the recording plus the clock shift of the traversal."""
MAP = "map"
ROBOT, WAY, OBJECTS = f"{MAP}/robot", f"{MAP}/way", f"{MAP}/objects"
RELATIONS, STATES, CHANGES = "relations", "states", "changes"


def main_camera() -> str:
    """The entity of a robot's only camera, or of the first of its rig."""
    return camera(MAIN_CAMERA)


def camera(camera_id: str) -> str:
    """The entity of a camera."""
    return f"{ROBOT}/{safe(camera_id)}"


def thing(number: int) -> str:
    """The entity of an instance."""
    return f"{OBJECTS}/{number}"


def safe(name: str) -> str:
    """A name as one part of a path: Rerun's own escapes are not needed."""
    return "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in name) or "_"


def blueprint() -> rrb.Blueprint:
    """3D, the camera's image with boxes and masks, relations as a graph, states over time, changes as a log."""
    whole = rrb.VisibleTimeRanges(
        timeline=TIMELINE, start=rrb.TimeRangeBoundary.infinite(), end=rrb.TimeRangeBoundary.cursor_relative()
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Spatial3DView(origin=MAP, name="Map", contents=["$origin/**"], overrides={WAY: whole}),
            rrb.Vertical(
                rrb.Spatial2DView(origin=f"{main_camera()}/image", name="Camera"),
                rrb.Tabs(
                    rrb.GraphView(origin=RELATIONS, name="Relations"),
                    rrb.StateTimelineView(origin=STATES, name="States"),
                    rrb.TextLogView(origin=CHANGES, name="Changes"),
                ),
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )
