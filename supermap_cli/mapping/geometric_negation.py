"""ObjNegate by geometry (Algorithm 1, step 2: O_neg <- O_front): the depth shows an object's place empty.

The paper negates whatever a ray went through. Here an object is gone only when looks in a row, or looks at parts that
add up to enough of it, say so: one depth image has errors, and a pose that is off by a hand's breadth empties the
place of a cup.
"""

from __future__ import annotations

from supermap_cli.mapping.absence import ABSENT_LOOKS, ABSENT_SHARE, OBSERVABLE_SHARE
from supermap_cli.mapping.fusion import fuse_geometry
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView


def update_absence(obj: MapObject, view: ObjectView, stamp_ns: int) -> int | None:
    """Take in a look at an object's place that did not find it; since when it has been seen to be gone, if it is.

    Either looks in a row saw through it, or looks at parts of it did that make up enough of the whole.
    """
    whole, emptied = view.observable_share >= OBSERVABLE_SHARE, view.contradicted_share > ABSENT_SHARE
    if whole and emptied:
        obj.absent_looks += 1
        if obj.absent_looks == 1:
            obj.first_absent_ns = stamp_ns
    run = obj.empty_run
    if whole and not emptied:
        obj.absent_looks = 0
        run.end()
    else:
        run.take_in(obj.voxels.codes, view.observable & view.solid, view.contradicted & view.solid, stamp_ns)
    if not obj.present:
        return None
    if obj.absent_looks >= ABSENT_LOOKS:
        return obj.first_absent_ns
    return run.began_ns if run.shows_absence(view.reachable) else None


def negate_by_geometry(obj: MapObject, view: ObjectView, stamp_ns: int) -> int | None:
    """What the depth says of an object that no detection was assigned to; since when it is gone, if it is.

    Of one that is not gone, the voxels take in what the rays say.
    """
    gone_ns = update_absence(obj, view, stamp_ns)
    if gone_ns is not None:
        return gone_ns
    if view.contradicted_share > ABSENT_SHARE:
        obj.visit.contradicted += 1
    elif view.observable_share >= OBSERVABLE_SHARE:
        fuse_geometry(obj, view)
    return None
