"""What a traversal that begins finds in the database."""

from __future__ import annotations

from collections.abc import Iterator

from supermap_cli.mapping.restoring import restore_objects
from supermap_cli.mapping.structure import StructureParameters
from supermap_cli.memory.store import MapStore
from supermap_cli.stages.map_registration import EarlierTraversals
from supermap_cli.stages.session_state import PriorMap
from supermap_cli.types.memory import KeyframeRecord


def load_prior_map(store: MapStore, traversal_id: int | None = None) -> PriorMap:
    """What earlier traversals left. The traversal that begins may be entered already, by its id."""
    traversals = store.traversals()
    earlier = [traversal for traversal in traversals if traversal.id != traversal_id]
    entered = [traversal.number for traversal in traversals if traversal.id == traversal_id]
    further = max((traversal.number for traversal in earlier), default=0) + 1
    return PriorMap(
        restore_objects(store.load_instances(), store.next_object_number()),
        store.load_spatial_edges(open_only=True),
        lambda: stored_keyframes(store),
        tuple(traversal.T_map_odom for traversal in reversed(earlier)),
        entered[0] if entered else further,
    )


def earlier_traversals(
    store: MapStore, parameters: StructureParameters, *, without: int | None = None
) -> EarlierTraversals:
    """What a further traversal is placed by; the traversal `without` is about to go."""
    earlier = [traversal for traversal in store.traversals() if traversal.id != without]
    numbers = [traversal.id for traversal in earlier]
    prior = PriorMap(
        keyframes=lambda: ((0, record) for record in store.keyframe_depths(numbers)),
        T_map_odom=tuple(traversal.T_map_odom for traversal in reversed(earlier)),
    )
    return prior.earlier(parameters)


def stored_keyframes(
    store: MapStore, *, last: int | None = None, until_ns: int | None = None
) -> Iterator[tuple[int, KeyframeRecord]]:
    """All keyframes with the number of their traversal; of the traversal `last` those up to a stamp."""
    for traversal in store.traversals():
        until = until_ns if traversal.id == last else None
        for record in store.keyframe_depths([traversal.id], until_ns=until):
            yield traversal.number, record
