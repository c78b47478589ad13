"""ObjNegate by geometry (Algorithm 1, step 2: O_neg <- O_front): the depth shows an object's place empty.

The paper negates whatever a ray went through. Here an object is gone only when views in a row, or views of parts that
add up to enough of it, say so: one depth image has errors, and a pose that is off by a hand's breadth empties the
place of a cup.
"""

from __future__ import annotations

from supermap_cli.mapping import absence, fusion
from supermap_cli.mapping.absence import AbsenceParameters
from supermap_cli.mapping.fusion import FusionParameters, fuse_geometry
from supermap_cli.mapping.objects import MapObject
from supermap_cli.mapping.visibility import ObjectView


def update_absence(
    obj: MapObject, view: ObjectView, stamp_ns: int, parameters: AbsenceParameters = absence.DEFAULT
) -> int | None:
    """Take in a view of an object's place that did not find it; since when it has been seen to be gone, if it is.

    Either views in a row went through it, or views of parts of it did that make up enough of the whole; for some time,
    if it had been found there just before: it would have gone before the robot's eyes.
    """
    evidence = obj.absence
    whole = view.observable_share >= parameters.observable_share
    emptied = view.contradicted_share > parameters.absent_share
    if whole and emptied:
        evidence.add_empty(stamp_ns)
    if whole and not emptied:
        evidence.add_occupied()
    else:
        judged, through = view.observable & view.solid, view.contradicted & view.solid
        evidence.parts.add(obj.voxels.codes, judged, through, stamp_ns, parameters)
    if not obj.present:
        return None
    if evidence.views >= parameters.absent_views and _lasts(obj, evidence.first_ns, stamp_ns, parameters):
        return evidence.first_ns
    parts = evidence.parts
    shown = parts.shows_absence(view.reachable, parameters) and _lasts(obj, parts.began_ns, stamp_ns, parameters)
    return parts.began_ns if shown else None


def _lasts(obj: MapObject, began_ns: int, stamp_ns: int, parameters: AbsenceParameters) -> bool:
    """Whether emptiness has lasted for longer than an error would, where the object has just been found there."""
    span_ns = parameters.error_span_s * 1e9
    return began_ns - obj.last_seen_ns >= span_ns or stamp_ns - began_ns >= span_ns


def negate_by_geometry(
    obj: MapObject,
    view: ObjectView,
    stamp_ns: int,
    parameters: AbsenceParameters = absence.DEFAULT,
    fusion_parameters: FusionParameters = fusion.DEFAULT,
) -> int | None:
    """What the depth says of an object that no detection was assigned to; since when it is gone, if it is.

    Of one that is not gone, the voxels take in what the rays say.
    """
    gone_ns = update_absence(obj, view, stamp_ns, parameters)
    if gone_ns is not None:
        return gone_ns
    if view.contradicted_share > parameters.absent_share:
        obj.visit.contradicted += 1
    elif view.observable_share >= parameters.observable_share:
        fuse_geometry(obj, view, fusion_parameters)
    return None
