"""The 4D memory: values to rows and back; the only user of database sessions."""

from supermap_cli.memory.opening import open_store
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import StoredTraversal, TraversalStart

__all__ = ["MapStore", "StoredTraversal", "TraversalStart", "open_store"]
