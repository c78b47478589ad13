"""The scenario `room`: a world made from a domain."""

from __future__ import annotations

from supermap_cli.simulation.domains.domain import Domain
from supermap_cli.simulation.furnished_building import MONDAY_NS, FurnishedBuilding, RandomStreams
from supermap_cli.simulation.scenario import Scenario
from supermap_cli.simulation.worlds.interior_changes import ChangedInterior, stays_with
from supermap_cli.simulation.worlds.room_recipes import DEMO_ROOM


def make_room(streams: RandomStreams, domain: Domain, seconds: float) -> Scenario:
    """A furnished room and the visits to it. Raises `SimulationError` where this attempt leaves no room for it."""
    building = FurnishedBuilding(streams, lambda _: {"office": DEMO_ROOM})
    traversal = building.traversal("visit-1", MONDAY_NS, seconds)
    stays = stays_with(building.interior, ChangedInterior(), None)
    return building.scenario("room", domain.rig, [traversal], stays, [])
