"""The numbers of navigation, each with its unit, meaning and source."""

from __future__ import annotations

from dataclasses import dataclass

from supermap_cli.types.parameters import TUNED, parameter


@dataclass(frozen=True)
class NavigationParameters:
    """How free floor is told from depth images, and where a robot may stand and drive."""

    cell_m: float = parameter(0.05, "m", "edge of a grid cell", "default of nav2's costmaps", at_least=0.01)
    level_m: float = parameter(
        0.1, "m", "height between the levels that are looked through", "two cells", at_least=0.02
    )
    lowest_m: float = parameter(
        0.1, "m", "lowest level that is looked through: what is lower counts as floor", "3 sigma of depth at 4 m"
    )
    floor_m: float = parameter(0.08, "m", "a return within this of z = 0 shows the floor", "3 sigma of depth at 4 m")
    top_m: float = parameter(2.6, "m", "up to this height things hide others", "a ceiling")
    reach_m: float = parameter(5.0, "m", "depth that is used: beyond it pixels are wider than cells", TUNED)
    min_hits: int = parameter(2, "1", "views with returns from a voxel for it to be occupied", "two witnesses")
    hit_share: float = parameter(
        0.3, "1", "these among all views of a voxel: people who pass are seen and looked through", TUNED, at_most=1
    )
    enough_passes: int = parameter(
        6, "1", "views through a whole column after which no more are tested", "bounds the time", at_least=2
    )
    views_per_cell: int = parameter(
        2, "1", "depth images of each viewpoint (0.5 m, 30 deg) and traversal", "bounds the time", at_least=1
    )
    traversals_per_cell: int = parameter(
        3, "1", "newest traversals of each viewpoint whose images are used", "bounds the time", at_least=1
    )
    most_voxels: int = parameter(
        80_000_000, "1", "voxels of a grid at most: cells are made larger instead", "250 MB of memory", at_least=1000
    )
    longest_step_m: float = parameter(
        0.7, "m", "between two keyframes that a robot drove straight", "1.5 m/s at two keyframes a second"
    )
    margin_m: float = parameter(
        0.1, "m", "clearance kept beyond the robot's radius: a cell, and what the map is off by", TUNED
    )
    comfort_m: float = parameter(0.3, "m", "clearance beyond that, within which ways are dearer", TUNED, at_least=0.01)
    comfort_cost: float = parameter(2.0, "1", "how much dearer a way is that keeps no more than it must", TUNED)
    farthest_standoff_m: float = parameter(
        2.5, "m", "distance from a thing at which a robot still stands before it", TUNED
    )
    start_search_m: float = parameter(
        0.6, "m", "a robot that is told to stand where it may not is taken to stand this near", TUNED
    )
    seen_share: float = parameter(
        0.3, "1", "share of a thing's points in sight for it to be seen from a place", TUNED, at_most=1
    )
    turn_cost_m: float = parameter(0.6, "m", "what a radian off the directions that it was seen from costs", TUNED)
    most_turn_deg: float = parameter(
        75.0, "deg", "that a place may lie off these directions: behind a wall a thing is not seen", TUNED, at_most=180
    )
    flat_share: float = parameter(
        0.3, "1", "thickness of a thing among its width, up to which it has a front and a back", TUNED, at_most=1
    )
    least_slant_deg: float = parameter(
        20.0, "deg", "between the plane of a flat thing and the look at it", TUNED, at_most=90
    )
    way_cost: float = parameter(0.05, "1", "what a metre of way costs, of a metre off the stand-off", TUNED)
    own_m: float = parameter(
        0.15, "m", "what is this near to a thing's point does not hide it: itself, and what it stands on", "1.5 levels"
    )
    target_points: int = parameter(40, "1", "points of a thing that are looked for", "bounds the time", at_least=1)


DEFAULT = NavigationParameters()

STANDOFF_M = 0.8
"""m between a robot's centre and a thing's box: within the reach of a mobile manipulator's arm (0.75 to 1 m)."""
ROBOT_RADIUS_M = 0.22
"""m, `robot_radius` of nav2's example parameters (a TurtleBot 3)."""
ROBOT_HEIGHTS_M = (0.3, 2.0)
"""m, bounds of the height that is told from the cameras."""
ABOVE_CAMERA_M = 0.1
"""m that a robot reaches above its highest camera: a mast's cap."""
