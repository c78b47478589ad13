"""Blows a small memory up by SQL, for tests of what must not grow with it."""

from __future__ import annotations

from pathlib import Path

from support import memories as m

GROW = """
CREATE TEMP TABLE copy AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < {instances})
SELECT i, 1000 + i AS number FROM n;
INSERT INTO instance SELECT copy.number, 'box-' || copy.number, 'box', presence, existence_log_odds,
    state.first_seen_ns, state.last_seen_ns, state.x + copy.i, state.y, state.z,
    state.center_x + copy.i, state.center_y, state.center_z, state.size_x, state.size_y, state.size_z, state.yaw,
    observations, merged_into, instance.traversal_id, replace(label_belief, instance.label, 'box'), engine_state,
    voxels, embedding
    FROM copy JOIN instance ON instance.number = 1
    JOIN state ON state.instance_number = 1 AND state.state_index = 0;
INSERT INTO state (instance_number, state_index, first_seen_ns, last_seen_ns, label, confidence, x, y, z,
    center_x, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id)
    SELECT copy.number, 0, first_seen_ns, last_seen_ns, 'box', confidence, x + copy.i, y, z,
    center_x + copy.i, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id
    FROM copy JOIN state ON state.instance_number = 1 AND state.state_index = 0;
INSERT INTO visit SELECT traversal_id, copy.number, supported, in_view, contradicted, first_support_ns, last_support_ns
    FROM copy JOIN visit ON visit.instance_number = 1;
INSERT INTO spatial_edge (subject_number, relation, object_number, since_ns, confidence, traversal_id)
    SELECT number, 'near', number - 1, {since_ns}, 0.9, 1 FROM copy WHERE i > 1;
INSERT INTO observation (keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z,
    evidence_for, evidence_against, hypotheses, crop_jpeg)
    SELECT keyframe_id, copy.number, track_id, 'box', score, u_min, v_min, u_max, v_max, x, y, z,
    evidence_for, evidence_against, replace(hypotheses, label, 'box'), crop_jpeg
    FROM copy JOIN observation ON observation.instance_number = 1;
UPDATE traversal SET observations = (SELECT count(*) FROM observation JOIN keyframe ON keyframe.id = keyframe_id
    WHERE keyframe.traversal_id = traversal.id);
DROP TABLE copy;
"""


def grow(path: Path, instances: int) -> Path:
    """Add so many boxes, each a copy of the first instance with all that was seen of it."""
    m.run_sql(path, GROW.format(instances=instances, since_ns=m.ns(1)))
    m.renew_checksums(path)
    return path
