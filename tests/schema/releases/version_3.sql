-- A memory as SuperMap made it at schema version 3: two traversals, and a third whose build was killed after a checkpoint.
PRAGMA application_id = 1397571920;
PRAGMA user_version = 3;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
CREATE TABLE traversal (
	id INTEGER NOT NULL, 
	number INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	recording TEXT NOT NULL, 
	fingerprint TEXT NOT NULL, 
	start_ns INTEGER NOT NULL, 
	end_ns INTEGER NOT NULL, 
	"T_map_odom" TEXT NOT NULL, 
	config TEXT NOT NULL, 
	versions TEXT NOT NULL, 
	status TEXT NOT NULL, 
	mapped_ns INTEGER, 
	timings TEXT, clock_shift_ns INTEGER DEFAULT 0 NOT NULL, crops_kept_from_ns INTEGER, observations_kept_from_ns INTEGER, thumbnails_kept_from_ns INTEGER, keyframes INTEGER DEFAULT 0 NOT NULL, observations INTEGER DEFAULT 0 NOT NULL, warnings TEXT DEFAULT '[]' NOT NULL, 
	CONSTRAINT pk_traversal PRIMARY KEY (id), 
	CONSTRAINT uq_traversal_number UNIQUE (number), 
	CONSTRAINT uq_traversal_name UNIQUE (name), 
	CONSTRAINT ck_traversal_span CHECK (end_ns >= start_ns), 
	CONSTRAINT ck_traversal_status CHECK (status IN ('building', 'complete'))
)
 STRICT;
CREATE TABLE instance (
	number INTEGER NOT NULL, 
	id TEXT NOT NULL, 
	label TEXT NOT NULL, 
	presence TEXT NOT NULL, 
	existence_log_odds REAL NOT NULL, 
	first_seen_ns INTEGER NOT NULL, 
	last_seen_ns INTEGER NOT NULL, 
	x REAL NOT NULL, 
	y REAL NOT NULL, 
	z REAL NOT NULL, 
	center_x REAL NOT NULL, 
	center_y REAL NOT NULL, 
	center_z REAL NOT NULL, 
	size_x REAL NOT NULL, 
	size_y REAL NOT NULL, 
	size_z REAL NOT NULL, 
	yaw REAL NOT NULL, 
	observations INTEGER NOT NULL, 
	merged_into INTEGER, 
	traversal_id INTEGER NOT NULL, 
	label_belief TEXT NOT NULL, 
	engine_state TEXT NOT NULL, 
	voxels BLOB NOT NULL, 
	embedding BLOB, 
	CONSTRAINT pk_instance PRIMARY KEY (number), 
	CONSTRAINT uq_instance_id UNIQUE (id), 
	CONSTRAINT fk_instance_merged_into FOREIGN KEY(merged_into) REFERENCES instance (number) DEFERRABLE INITIALLY DEFERRED, 
	CONSTRAINT fk_instance_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT ck_instance_presence CHECK (presence IN ('present', 'absent', 'doubted')), 
	CONSTRAINT ck_instance_span CHECK (last_seen_ns >= first_seen_ns), 
	CONSTRAINT ck_instance_size CHECK (size_x >= 0 AND size_y >= 0 AND size_z >= 0), 
	CONSTRAINT ck_instance_observations CHECK (observations >= 0), 
	CONSTRAINT ck_instance_merged_into CHECK (merged_into <> number)
)
 STRICT;
CREATE TABLE observation (
	id INTEGER NOT NULL, 
	keyframe_id INTEGER NOT NULL, 
	instance_number INTEGER NOT NULL, 
	track_id INTEGER NOT NULL, 
	label TEXT NOT NULL, 
	score REAL NOT NULL, 
	u_min REAL NOT NULL, 
	v_min REAL NOT NULL, 
	u_max REAL NOT NULL, 
	v_max REAL NOT NULL, 
	x REAL NOT NULL, 
	y REAL NOT NULL, 
	z REAL NOT NULL, 
	evidence_for INTEGER NOT NULL, 
	evidence_against INTEGER NOT NULL, 
	hypotheses TEXT NOT NULL, 
	crop_jpeg BLOB, 
	CONSTRAINT pk_observation PRIMARY KEY (id), 
	CONSTRAINT fk_observation_keyframe_id FOREIGN KEY(keyframe_id) REFERENCES keyframe (id), 
	CONSTRAINT fk_observation_instance_number FOREIGN KEY(instance_number) REFERENCES instance (number), 
	CONSTRAINT ck_observation_score CHECK (score >= 0 AND score <= 1), 
	CONSTRAINT ck_observation_evidence CHECK (evidence_for >= 0 AND evidence_against >= 0)
)
 STRICT;
CREATE TABLE state (
	id INTEGER NOT NULL, 
	instance_number INTEGER NOT NULL, 
	state_index INTEGER NOT NULL, 
	first_seen_ns INTEGER NOT NULL, 
	last_seen_ns INTEGER NOT NULL, 
	gone_ns INTEGER, 
	empty_before_ns INTEGER, 
	label TEXT NOT NULL, 
	confidence REAL NOT NULL, 
	x REAL NOT NULL, 
	y REAL NOT NULL, 
	z REAL NOT NULL, 
	center_x REAL NOT NULL, 
	center_y REAL NOT NULL, 
	center_z REAL NOT NULL, 
	size_x REAL NOT NULL, 
	size_y REAL NOT NULL, 
	size_z REAL NOT NULL, 
	yaw REAL NOT NULL, 
	traversal_id INTEGER NOT NULL, 
	CONSTRAINT pk_state PRIMARY KEY (id), 
	CONSTRAINT uq_state_instance_number_state_index UNIQUE (instance_number, state_index), 
	CONSTRAINT fk_state_instance_number FOREIGN KEY(instance_number) REFERENCES instance (number), 
	CONSTRAINT fk_state_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT ck_state_state_index CHECK (state_index >= 0), 
	CONSTRAINT ck_state_support CHECK (last_seen_ns >= first_seen_ns), 
	CONSTRAINT ck_state_gone CHECK (gone_ns > last_seen_ns), 
	CONSTRAINT ck_state_empty_before CHECK (empty_before_ns < first_seen_ns), 
	CONSTRAINT ck_state_confidence CHECK (confidence >= 0 AND confidence <= 1), 
	CONSTRAINT ck_state_size CHECK (size_x >= 0 AND size_y >= 0 AND size_z >= 0)
)
 STRICT;
CREATE TABLE visit (
	traversal_id INTEGER NOT NULL, 
	instance_number INTEGER NOT NULL, 
	supported INTEGER NOT NULL, 
	in_view INTEGER NOT NULL, 
	contradicted INTEGER NOT NULL, 
	first_support_ns INTEGER, 
	last_support_ns INTEGER, 
	CONSTRAINT pk_visit PRIMARY KEY (traversal_id, instance_number), 
	CONSTRAINT fk_visit_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT fk_visit_instance_number FOREIGN KEY(instance_number) REFERENCES instance (number), 
	CONSTRAINT ck_visit_counts CHECK (supported >= 0 AND in_view >= 0 AND contradicted >= 0), 
	CONSTRAINT ck_visit_support CHECK (last_support_ns >= first_support_ns)
)
 STRICT;
CREATE TABLE spatial_edge (
	id INTEGER NOT NULL, 
	subject_number INTEGER NOT NULL, 
	relation TEXT NOT NULL, 
	object_number INTEGER NOT NULL, 
	since_ns INTEGER NOT NULL, 
	until_ns INTEGER, 
	confidence REAL NOT NULL, 
	traversal_id INTEGER NOT NULL, 
	CONSTRAINT pk_spatial_edge PRIMARY KEY (id), 
	CONSTRAINT uq_spatial_edge_subject_number_relation_object_number_since_ns UNIQUE (subject_number, relation, object_number, since_ns), 
	CONSTRAINT fk_spatial_edge_subject_number FOREIGN KEY(subject_number) REFERENCES instance (number), 
	CONSTRAINT fk_spatial_edge_object_number FOREIGN KEY(object_number) REFERENCES instance (number), 
	CONSTRAINT fk_spatial_edge_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT ck_spatial_edge_two_ends CHECK (subject_number <> object_number), 
	CONSTRAINT ck_spatial_edge_interval CHECK (until_ns > since_ns), 
	CONSTRAINT ck_spatial_edge_confidence CHECK (confidence >= 0 AND confidence <= 1)
)
 STRICT;
CREATE TABLE temporal_edge (
	id INTEGER NOT NULL, 
	kind TEXT NOT NULL, 
	from_number INTEGER NOT NULL, 
	from_state INTEGER, 
	to_number INTEGER NOT NULL, 
	to_state INTEGER, 
	not_before_ns INTEGER, 
	not_after_ns INTEGER NOT NULL, 
	probability REAL NOT NULL, 
	distance_m REAL, 
	traversal_id INTEGER NOT NULL, 
	CONSTRAINT pk_temporal_edge PRIMARY KEY (id), 
	CONSTRAINT fk_temporal_edge_from_number FOREIGN KEY(from_number) REFERENCES instance (number), 
	CONSTRAINT fk_temporal_edge_to_number FOREIGN KEY(to_number) REFERENCES instance (number), 
	CONSTRAINT fk_temporal_edge_from_number_from_state FOREIGN KEY(from_number, from_state) REFERENCES state (instance_number, state_index) DEFERRABLE INITIALLY DEFERRED, 
	CONSTRAINT fk_temporal_edge_to_number_to_state FOREIGN KEY(to_number, to_state) REFERENCES state (instance_number, state_index) DEFERRABLE INITIALLY DEFERRED, 
	CONSTRAINT fk_temporal_edge_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT ck_temporal_edge_kind CHECK (kind IN ('appeared', 'persisted', 'moved', 'disappeared', 'reappeared', 'merged', 'split', 'candidate')), 
	CONSTRAINT ck_temporal_edge_bounds CHECK (not_before_ns <= not_after_ns), 
	CONSTRAINT ck_temporal_edge_probability CHECK (probability >= 0 AND probability <= 1), 
	CONSTRAINT ck_temporal_edge_distance CHECK (distance_m >= 0)
)
 STRICT;
CREATE TABLE before_image (
	traversal_id INTEGER NOT NULL, 
	table_name TEXT NOT NULL, 
	row_key INTEGER NOT NULL, 
	content TEXT NOT NULL, 
	CONSTRAINT pk_before_image PRIMARY KEY (traversal_id, table_name, row_key), 
	CONSTRAINT fk_before_image_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id)
)
 STRICT;
CREATE TABLE checkpoint (
	traversal_id INTEGER NOT NULL, 
	part TEXT NOT NULL, 
	stamp_ns INTEGER NOT NULL, 
	content BLOB NOT NULL, 
	CONSTRAINT pk_checkpoint PRIMARY KEY (traversal_id, part), 
	CONSTRAINT fk_checkpoint_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id)
)
 STRICT;
CREATE VIRTUAL TABLE state_box USING rtree(state_id, min_x, max_x, min_y, max_y, min_z, max_z);
CREATE VIRTUAL TABLE instance_label USING fts5(id, label, labels, tokenize = 'porter unicode61');
CREATE TABLE keyframe (
	id INTEGER NOT NULL, 
	traversal_id INTEGER NOT NULL, 
	stamp_ns INTEGER NOT NULL, 
	detected INTEGER NOT NULL, 
	"T_map_base" TEXT NOT NULL, 
	"T_map_camera" TEXT NOT NULL, 
	camera TEXT NOT NULL, 
	depth_step INTEGER NOT NULL, 
	depth_png BLOB NOT NULL, 
	thumbnail_jpeg BLOB, 
	camera_id TEXT NOT NULL, 
	CONSTRAINT pk_keyframe PRIMARY KEY (id), 
	CONSTRAINT ck_keyframe_detected CHECK (detected IN (0, 1)), 
	CONSTRAINT ck_keyframe_depth_step CHECK (depth_step >= 1), 
	CONSTRAINT fk_keyframe_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT uq_keyframe_traversal_id_stamp_ns_camera_id UNIQUE (traversal_id, stamp_ns, camera_id)
)
 STRICT;
CREATE INDEX ix_traversal_fingerprint ON traversal (fingerprint);
CREATE INDEX ix_instance_label ON instance (label);
CREATE INDEX ix_observation_keyframe_id ON observation (keyframe_id);
CREATE INDEX ix_spatial_edge_object_number ON spatial_edge (object_number);
CREATE INDEX ix_temporal_edge_from_number_from_state ON temporal_edge (from_number, from_state);
CREATE INDEX ix_temporal_edge_to_number_to_state ON temporal_edge (to_number, to_state);
CREATE INDEX ix_instance_label_presence_last_seen_ns ON instance (label, presence, last_seen_ns) WHERE merged_into IS NULL;
CREATE INDEX ix_instance_presence_last_seen_ns ON instance (presence, last_seen_ns) WHERE merged_into IS NULL;
CREATE INDEX ix_instance_merged_into ON instance (merged_into) WHERE merged_into IS NOT NULL;
CREATE INDEX ix_observation_instance_number_keyframe_id_score ON observation (instance_number, keyframe_id, score);
CREATE INDEX ix_observation_instance_number ON observation (instance_number) WHERE crop_jpeg IS NOT NULL;
CREATE INDEX ix_state_label_instance_number ON state (label, instance_number);
CREATE INDEX ix_state_first_seen_ns_instance_number ON state (first_seen_ns, instance_number);
CREATE INDEX ix_state_gone_ns_instance_number ON state (gone_ns, instance_number) WHERE gone_ns IS NOT NULL;
CREATE INDEX ix_visit_instance_number_traversal_id ON visit (instance_number, traversal_id);
CREATE INDEX ix_temporal_edge_not_after_ns ON temporal_edge (not_after_ns);
CREATE TRIGGER state_is_disjoint_on_insert BEFORE INSERT ON state
    WHEN EXISTS (SELECT 1 FROM state AS other
                 WHERE other.instance_number = NEW.instance_number AND other.state_index <> NEW.state_index
                 AND other.first_seen_ns <= NEW.last_seen_ns AND NEW.first_seen_ns <= other.last_seen_ns)
    BEGIN SELECT RAISE(ABORT, 'states of one instance overlap'); END;
CREATE TRIGGER state_is_disjoint_on_update BEFORE UPDATE OF first_seen_ns, last_seen_ns ON state
    WHEN EXISTS (SELECT 1 FROM state AS other
                 WHERE other.instance_number = NEW.instance_number AND other.state_index <> NEW.state_index
                 AND other.first_seen_ns <= NEW.last_seen_ns AND NEW.first_seen_ns <= other.last_seen_ns)
    BEGIN SELECT RAISE(ABORT, 'states of one instance overlap'); END;
CREATE TRIGGER state_box_insert AFTER INSERT ON state
    BEGIN
      INSERT INTO state_box VALUES (
        NEW.id, NEW.center_x - (NEW.size_x + NEW.size_y) / 2, NEW.center_x + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_y - (NEW.size_x + NEW.size_y) / 2, NEW.center_y + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_z - NEW.size_z / 2, NEW.center_z + NEW.size_z / 2);
    END;
CREATE TRIGGER state_box_update AFTER UPDATE ON state
    BEGIN
      DELETE FROM state_box WHERE state_id = OLD.id;
      INSERT INTO state_box VALUES (
        NEW.id, NEW.center_x - (NEW.size_x + NEW.size_y) / 2, NEW.center_x + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_y - (NEW.size_x + NEW.size_y) / 2, NEW.center_y + (NEW.size_x + NEW.size_y) / 2,
        NEW.center_z - NEW.size_z / 2, NEW.center_z + NEW.size_z / 2);
    END;
CREATE TRIGGER state_box_delete AFTER DELETE ON state
    BEGIN
      DELETE FROM state_box WHERE state_id = OLD.id;
    END;
CREATE TRIGGER instance_label_insert AFTER INSERT ON instance
    BEGIN
      INSERT INTO instance_label (rowid, id, label, labels) VALUES (
        NEW.number, NEW.id, NEW.label, (SELECT group_concat(key, ', ') FROM json_each(NEW.label_belief)));
    END;
CREATE TRIGGER instance_label_update AFTER UPDATE OF label, label_belief ON instance
    WHEN OLD.label <> NEW.label OR OLD.label_belief <> NEW.label_belief
    BEGIN
      DELETE FROM instance_label WHERE rowid = OLD.number;
      INSERT INTO instance_label (rowid, id, label, labels) VALUES (
        NEW.number, NEW.id, NEW.label, (SELECT group_concat(key, ', ') FROM json_each(NEW.label_belief)));
    END;
CREATE TRIGGER instance_label_delete AFTER DELETE ON instance
    BEGIN
      DELETE FROM instance_label WHERE rowid = OLD.number;
    END;
CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation
    WHEN NEW.crop_jpeg IS NOT NULL OR (NEW.id, NEW.keyframe_id, NEW.instance_number, NEW.track_id, NEW.label, NEW.score,
          NEW.u_min, NEW.v_min, NEW.u_max, NEW.v_max, NEW.x, NEW.y, NEW.z, NEW.evidence_for, NEW.evidence_against,
          NEW.hypotheses)
      IS NOT (OLD.id, OLD.keyframe_id, OLD.instance_number, OLD.track_id, OLD.label, OLD.score,
          OLD.u_min, OLD.v_min, OLD.u_max, OLD.v_max, OLD.x, OLD.y, OLD.z, OLD.evidence_for, OLD.evidence_against,
          OLD.hypotheses)
      OR NOT EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id AND keyframe.stamp_ns < traversal.crops_kept_from_ns)
    BEGIN SELECT RAISE(ABORT, 'observations are never changed'); END;
CREATE TRIGGER observation_is_kept BEFORE DELETE ON observation
    WHEN EXISTS (SELECT 1 FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id AND traversal.status = 'complete'
          AND (traversal.observations_kept_from_ns IS NULL
               OR keyframe.stamp_ns >= traversal.observations_kept_from_ns))
    BEGIN SELECT RAISE(ABORT, 'observations of a complete traversal are never deleted'); END;
CREATE VIEW current_objects AS
    SELECT instance.id, instance.label, round(state.confidence, 3) AS confidence,
           round(instance.x, 3) AS x, round(instance.y, 3) AS y, round(instance.z, 3) AS z,
           round(instance.size_x, 3) AS size_x, round(instance.size_y, 3) AS size_y, round(instance.size_z, 3) AS size_z, round(instance.yaw, 3) AS yaw,
           (SELECT group_concat(edge.relation || ' ' || other.id, ', ')
            FROM spatial_edge AS edge JOIN instance AS other ON other.number = edge.object_number
            WHERE edge.subject_number = instance.number AND edge.until_ns IS NULL
            AND edge.relation <> 'near') AS stands,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', instance.first_seen_ns / 1000000000, 'unixepoch') || '.' || (instance.first_seen_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN instance.first_seen_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (instance.first_seen_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS first_seen, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', instance.last_seen_ns / 1000000000, 'unixepoch') || '.' || (instance.last_seen_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN instance.last_seen_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (instance.last_seen_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS last_seen,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', state.first_seen_ns / 1000000000, 'unixepoch') || '.' || (state.first_seen_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN state.first_seen_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (state.first_seen_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS since,
           first_traversal.name AS first_traversal,
           (SELECT traversal.name FROM visit JOIN traversal ON traversal.id = visit.traversal_id
            WHERE visit.instance_number = instance.number AND visit.supported > 0
            ORDER BY visit.traversal_id DESC LIMIT 1) AS last_traversal,
           instance.observations, instance.first_seen_ns, instance.last_seen_ns, state.first_seen_ns AS since_ns
    FROM instance JOIN traversal AS first_traversal ON first_traversal.id = instance.traversal_id
    LEFT JOIN state ON state.instance_number = instance.number AND state.state_index =
        (SELECT max(newest.state_index) FROM state AS newest WHERE newest.instance_number = instance.number)
    WHERE instance.presence = 'present' AND instance.merged_into IS NULL
    ORDER BY instance.number;
CREATE VIEW object_history AS
    SELECT instance.id, state.state_index, state.label,
           CASE WHEN instance.merged_into IS NOT NULL THEN 'merged'
                WHEN state.state_index = (SELECT max(newest.state_index) FROM state AS newest
                                          WHERE newest.instance_number = state.instance_number)
                THEN instance.presence ELSE 'ended' END AS presence,
           round(state.confidence, 3) AS confidence, round(state.x, 3) AS x, round(state.y, 3) AS y, round(state.z, 3) AS z,
           (SELECT round(max(edge.distance_m), 3) FROM temporal_edge AS edge
            WHERE edge.to_number = state.instance_number AND edge.to_state = state.state_index
            AND edge.kind = 'moved') AS moved_m,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', state.empty_before_ns / 1000000000, 'unixepoch') || '.' || (state.empty_before_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN state.empty_before_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (state.empty_before_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS empty_before, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', state.first_seen_ns / 1000000000, 'unixepoch') || '.' || (state.first_seen_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN state.first_seen_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (state.first_seen_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS first_seen,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', state.last_seen_ns / 1000000000, 'unixepoch') || '.' || (state.last_seen_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN state.last_seen_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (state.last_seen_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS last_seen, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', state.gone_ns / 1000000000, 'unixepoch') || '.' || (state.gone_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN state.gone_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (state.gone_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS gone,
           traversal.name AS first_traversal,
           (SELECT survivor.id FROM instance AS survivor WHERE survivor.number = instance.merged_into) AS merged_into,
           state.empty_before_ns, state.first_seen_ns, state.last_seen_ns, state.gone_ns
    FROM state JOIN instance ON instance.number = state.instance_number
    JOIN traversal ON traversal.id = state.traversal_id
    ORDER BY state.instance_number, state.state_index;
CREATE VIEW changes AS
    SELECT edge.kind, target.id, target.label,
           round(before.x, 3) AS from_x, round(before.y, 3) AS from_y, round(before.z, 3) AS from_z,
           round(after.x, 3) AS to_x, round(after.y, 3) AS to_y, round(after.z, 3) AS to_z, round(edge.distance_m, 3) AS distance_m,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', edge.not_before_ns / 1000000000, 'unixepoch') || '.' || (edge.not_before_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN edge.not_before_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (edge.not_before_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS not_before, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', edge.not_after_ns / 1000000000, 'unixepoch') || '.' || (edge.not_after_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN edge.not_after_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (edge.not_after_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS not_after,
           traversal.name AS traversal, round(edge.probability, 3) AS probability,
           source.id AS from_id, edge.from_state, target.id AS to_id, edge.to_state,
           edge.not_before_ns, edge.not_after_ns
    FROM temporal_edge AS edge JOIN instance AS source ON source.number = edge.from_number
    JOIN instance AS target ON target.number = edge.to_number
    JOIN traversal ON traversal.id = edge.traversal_id
    LEFT JOIN state AS before ON before.instance_number = edge.from_number AND before.state_index = edge.from_state
    LEFT JOIN state AS after ON after.instance_number = edge.to_number AND after.state_index = edge.to_state
        AND edge.kind <> 'disappeared'
    WHERE edge.kind <> 'persisted' AND NOT (edge.kind = 'disappeared' AND EXISTS (SELECT 1 FROM temporal_edge AS move WHERE move.kind = 'moved'
        AND move.from_number = edge.from_number AND move.from_state = edge.from_state))
    ORDER BY edge.not_after_ns, edge.id;
CREATE VIEW relations AS
    SELECT subject.id AS subject, edge.relation, object.id AS object,
           subject.label AS subject_label, object.label AS object_label,
           CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', edge.since_ns / 1000000000, 'unixepoch') || '.' || (edge.since_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN edge.since_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (edge.since_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS since, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', edge.until_ns / 1000000000, 'unixepoch') || '.' || (edge.until_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN edge.until_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (edge.until_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS until,
           round(edge.confidence, 3) AS confidence, traversal.name AS traversal, edge.since_ns, edge.until_ns
    FROM spatial_edge AS edge JOIN instance AS subject ON subject.number = edge.subject_number
    JOIN instance AS object ON object.number = edge.object_number
    JOIN traversal ON traversal.id = edge.traversal_id
    ORDER BY edge.id;
CREATE VIEW trajectory AS
    SELECT traversal.name AS traversal, CASE WHEN (SELECT min(start_ns) FROM traversal) >= 946684800000000000 THEN strftime('%Y-%m-%dT%H:%M:%S', keyframe.stamp_ns / 1000000000, 'unixepoch') || '.' || (keyframe.stamp_ns / 100000000 % 10) || 'Z' ELSE CASE WHEN keyframe.stamp_ns - (SELECT min(start_ns) FROM traversal) IS NOT NULL THEN printf('%.1f s', (keyframe.stamp_ns - (SELECT min(start_ns) FROM traversal)) / 1e9) END END AS at,
           round(json_extract(keyframe.T_map_base, '$[0][3]'), 3) AS x, round(json_extract(keyframe.T_map_base, '$[1][3]'), 3) AS y, round(json_extract(keyframe.T_map_base, '$[2][3]'), 3) AS z, keyframe.camera_id, keyframe.stamp_ns
    FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
    ORDER BY traversal.number, keyframe.stamp_ns, keyframe.camera_id;
INSERT INTO alembic_version (version_num) VALUES ('0003');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings, clock_shift_ns, crops_kept_from_ns, observations_kept_from_ns, thumbnails_kept_from_ns, keyframes, observations, warnings) VALUES (1, 1, 'monday', 'recordings/monday.mcap', 'fingerprint of monday', 1767603600000000000, 1767603610000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'complete', 1767603604000000000, '{"detect":1.5}', 0, NULL, NULL, NULL, 2, 4, '[]');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings, clock_shift_ns, crops_kept_from_ns, observations_kept_from_ns, thumbnails_kept_from_ns, keyframes, observations, warnings) VALUES (2, 2, 'tuesday', 'recordings/tuesday.mcap', 'fingerprint of tuesday', 1767603700000000000, 1767603710000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'complete', 1767603704000000000, '{"detect":1.5}', 0, NULL, NULL, NULL, 2, 2, '[]');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings, clock_shift_ns, crops_kept_from_ns, observations_kept_from_ns, thumbnails_kept_from_ns, keyframes, observations, warnings) VALUES (3, 3, 'wednesday', 'recordings/wednesday.mcap', 'fingerprint of wednesday', 1767603800000000000, 1767603810000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'building', 1767603801000000000, NULL, 0, NULL, NULL, NULL, 1, 1, '[]');
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg, camera_id) VALUES (1, 1, 1767603601000000000, 1, '[[1.0,0.0,0.0,2.5],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,2.5],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, x'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL, 'camera');
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg, camera_id) VALUES (2, 1, 1767603604000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, x'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL, 'camera');
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg, camera_id) VALUES (3, 2, 1767603701000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, x'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL, 'camera');
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg, camera_id) VALUES (4, 2, 1767603704000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, x'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL, 'camera');
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg, camera_id) VALUES (5, 3, 1767603801000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, x'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL, 'camera');
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (1, 'chair-1', 'chair', 'present', 3.0, 1767603601000000000, 1767603704000000000, 3.0, 2.0, 0.5, 3.0, 2.0, 0.5, 0.5, 0.5, 1.0, 0.0, 3, NULL, 1, '{"chair":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', x'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (2, 'dining-table-1', 'dining table', 'present', 3.0, 1767603601000000000, 1767603604000000000, 5.0, 5.0, 0.5, 5.0, 5.0, 0.5, 0.5, 0.5, 1.0, 0.0, 2, NULL, 1, '{"dining table":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', x'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (3, 'cup-1', 'cup', 'present', 3.0, 1767603604000000000, 1767603604000000000, 5.0, 5.0, 1.0, 5.0, 5.0, 1.0, 0.5, 0.5, 1.0, 0.0, 1, 2, 1, '{"cup":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', x'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (4, 'potted-plant-1', 'plant', 'present', 3.0, 1767603701000000000, 1767603801000000000, 0.0, 1.0, 0.6, 0.0, 1.0, 0.6, 0.5, 0.5, 1.0, 0.0, 2, NULL, 2, '{"plant":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', x'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (1, 1, 1, 1, 'chair', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["chair",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (2, 1, 2, 2, 'dining table', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["dining table",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (3, 2, 1, 1, 'chair', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["chair",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (4, 2, 3, 3, 'cup', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["cup",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (5, 4, 1, 1, 'chair', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["chair",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (6, 3, 4, 4, 'potted plant', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["potted plant",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO observation (id, keyframe_id, instance_number, track_id, label, score, u_min, v_min, u_max, v_max, x, y, z, evidence_for, evidence_against, hypotheses, crop_jpeg) VALUES (7, 5, 4, 4, 'plant', 0.8, 10.0, 20.0, 110.0, 220.0, 1.0, 2.0, 0.5, 100, 2, '[["plant",0.8],["other",0.19999999999999996]]', NULL);
INSERT INTO state (id, instance_number, state_index, first_seen_ns, last_seen_ns, gone_ns, empty_before_ns, label, confidence, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id) VALUES (1, 1, 0, 1767603601000000000, 1767603604000000000, 1767603701000000000, NULL, 'chair', 0.9, 1.0, 2.0, 0.5, 1.0, 2.0, 0.5, 0.5, 0.5, 1.0, 0.0, 1);
INSERT INTO state (id, instance_number, state_index, first_seen_ns, last_seen_ns, gone_ns, empty_before_ns, label, confidence, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id) VALUES (2, 2, 0, 1767603601000000000, 1767603604000000000, NULL, NULL, 'dining table', 0.9, 5.0, 5.0, 0.5, 5.0, 5.0, 0.5, 0.5, 0.5, 1.0, 0.0, 1);
INSERT INTO state (id, instance_number, state_index, first_seen_ns, last_seen_ns, gone_ns, empty_before_ns, label, confidence, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id) VALUES (3, 1, 1, 1767603704000000000, 1767603704000000000, NULL, 1767603604000000000, 'chair', 0.9, 3.0, 2.0, 0.5, 3.0, 2.0, 0.5, 0.5, 0.5, 1.0, 0.0, 2);
INSERT INTO state (id, instance_number, state_index, first_seen_ns, last_seen_ns, gone_ns, empty_before_ns, label, confidence, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, traversal_id) VALUES (4, 4, 0, 1767603701000000000, 1767603801000000000, NULL, NULL, 'plant', 0.9, 0.0, 1.0, 0.6, 0.0, 1.0, 0.6, 0.5, 0.5, 1.0, 0.0, 2);
INSERT INTO visit (traversal_id, instance_number, supported, in_view, contradicted, first_support_ns, last_support_ns) VALUES (1, 1, 2, 2, 0, 1767603601000000000, 1767603604000000000);
INSERT INTO visit (traversal_id, instance_number, supported, in_view, contradicted, first_support_ns, last_support_ns) VALUES (1, 2, 1, 2, 0, 1767603601000000000, 1767603601000000000);
INSERT INTO visit (traversal_id, instance_number, supported, in_view, contradicted, first_support_ns, last_support_ns) VALUES (2, 1, 1, 2, 1, 1767603704000000000, 1767603704000000000);
INSERT INTO visit (traversal_id, instance_number, supported, in_view, contradicted, first_support_ns, last_support_ns) VALUES (2, 4, 1, 1, 0, 1767603701000000000, 1767603701000000000);
INSERT INTO visit (traversal_id, instance_number, supported, in_view, contradicted, first_support_ns, last_support_ns) VALUES (3, 4, 1, 1, 0, 1767603801000000000, 1767603801000000000);
INSERT INTO spatial_edge (id, subject_number, relation, object_number, since_ns, until_ns, confidence, traversal_id) VALUES (1, 1, 'near', 2, 1767603601000000000, 1767603701000000000, 0.9, 1);
INSERT INTO spatial_edge (id, subject_number, relation, object_number, since_ns, until_ns, confidence, traversal_id) VALUES (2, 4, 'beside', 1, 1767603704000000000, NULL, 0.9, 2);
INSERT INTO temporal_edge (id, kind, from_number, from_state, to_number, to_state, not_before_ns, not_after_ns, probability, distance_m, traversal_id) VALUES (1, 'moved', 1, 0, 1, 1, 1767603604000000000, 1767603704000000000, 0.8, 2.0, 2);
INSERT INTO before_image (traversal_id, table_name, row_key, content) VALUES (3, 'instance', 4, '{"number":4,"id":"potted-plant-1","label":"potted plant","presence":"present","existence_log_odds":3.0,"first_seen_ns":1767603701000000000,"last_seen_ns":1767603704000000000,"x":0.0,"y":1.0,"z":0.5,"center_x":0.0,"center_y":1.0,"center_z":0.5,"size_x":0.5,"size_y":0.5,"size_z":1.0,"yaw":0.0,"observations":1,"merged_into":null,"traversal_id":2,"label_belief":"{\"potted plant\":0.9,\"other\":0.1}","engine_state":"{\"label_logs\":{\"chair\":-0.1},\"unseen_log\":-3.0,\"looks\":1.0,\"viewpoints\":{\"1,1,1\":2},\"state_index\":0,\"state_first_seen_ns\":1767603601000000000,\"state_empty_before_ns\":null,\"gone_ns\":null,\"best_crop\":0.0}","voxels":{"hex":"534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57"},"embedding":null}');
INSERT INTO before_image (traversal_id, table_name, row_key, content) VALUES (3, 'state', 4, '{"id":4,"instance_number":4,"state_index":0,"first_seen_ns":1767603701000000000,"last_seen_ns":1767603704000000000,"gone_ns":null,"empty_before_ns":null,"label":"potted plant","confidence":0.9,"x":0.0,"y":1.0,"z":0.5,"center_x":0.0,"center_y":1.0,"center_z":0.5,"size_x":0.5,"size_y":0.5,"size_z":1.0,"yaw":0.0,"traversal_id":2}');
INSERT INTO checkpoint (traversal_id, part, stamp_ns, content) VALUES (3, 'engine', 1767603801000000000, x'00');
