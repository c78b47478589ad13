-- A memory as SuperMap 0.1 made it (schema version 1): two traversals, and a third whose build was killed.
PRAGMA application_id = 1397571920;
PRAGMA user_version = 1;
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
	timings TEXT, 
	CONSTRAINT pk_traversal PRIMARY KEY (id), 
	CONSTRAINT uq_traversal_number UNIQUE (number), 
	CONSTRAINT uq_traversal_name UNIQUE (name), 
	CONSTRAINT ck_traversal_span CHECK (end_ns >= start_ns), 
	CONSTRAINT ck_traversal_status CHECK (status IN ('building', 'complete'))
)
 STRICT;
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
	CONSTRAINT pk_keyframe PRIMARY KEY (id), 
	CONSTRAINT fk_keyframe_traversal_id FOREIGN KEY(traversal_id) REFERENCES traversal (id), 
	CONSTRAINT uq_keyframe_traversal_id_stamp_ns UNIQUE (traversal_id, stamp_ns), 
	CONSTRAINT ck_keyframe_detected CHECK (detected IN (0, 1)), 
	CONSTRAINT ck_keyframe_depth_step CHECK (depth_step >= 1)
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
CREATE VIRTUAL TABLE state_box USING rtree(state_id, min_x, max_x, min_y, max_y, min_z, max_z);
CREATE VIRTUAL TABLE instance_label USING fts5(id, label, labels, tokenize = 'porter unicode61');
CREATE INDEX ix_traversal_fingerprint ON traversal (fingerprint);
CREATE INDEX ix_instance_label ON instance (label);
CREATE INDEX ix_observation_keyframe_id ON observation (keyframe_id);
CREATE INDEX ix_observation_instance_number ON observation (instance_number);
CREATE INDEX ix_spatial_edge_object_number ON spatial_edge (object_number);
CREATE INDEX ix_temporal_edge_from_number_from_state ON temporal_edge (from_number, from_state);
CREATE INDEX ix_temporal_edge_to_number_to_state ON temporal_edge (to_number, to_state);
CREATE VIEW current_objects AS
    SELECT id, label, x, y, z, size_x, size_y, size_z, yaw, first_seen_ns, last_seen_ns, observations
    FROM instance WHERE presence = 'present' AND merged_into IS NULL;
CREATE VIEW object_history AS
    SELECT instance.id, state.state_index, state.label, state.confidence, state.x, state.y, state.z,
           state.empty_before_ns, state.first_seen_ns, state.last_seen_ns, state.gone_ns,
           traversal.name AS first_traversal
    FROM state JOIN instance ON instance.number = state.instance_number
    JOIN traversal ON traversal.id = state.traversal_id
    ORDER BY instance.number, state.state_index;
CREATE VIEW changes AS
    SELECT temporal_edge.kind, source.id AS from_id, temporal_edge.from_state, target.id AS to_id,
           temporal_edge.to_state, temporal_edge.not_before_ns, temporal_edge.not_after_ns,
           temporal_edge.distance_m, temporal_edge.probability, traversal.name AS traversal
    FROM temporal_edge JOIN instance AS source ON source.number = temporal_edge.from_number
    JOIN instance AS target ON target.number = temporal_edge.to_number
    JOIN traversal ON traversal.id = temporal_edge.traversal_id
    WHERE temporal_edge.kind <> 'persisted'
    ORDER BY temporal_edge.not_after_ns, temporal_edge.id;
CREATE VIEW trajectory AS
    SELECT traversal.name AS traversal, keyframe.stamp_ns,
           json_extract(keyframe.T_map_base, '$[0][3]') AS x,
           json_extract(keyframe.T_map_base, '$[1][3]') AS y,
           json_extract(keyframe.T_map_base, '$[2][3]') AS z
    FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
    ORDER BY keyframe.stamp_ns;
CREATE TRIGGER observation_is_immutable BEFORE UPDATE ON observation
    BEGIN SELECT RAISE(ABORT, 'observations are never changed'); END;
CREATE TRIGGER observation_is_kept BEFORE DELETE ON observation
    WHEN (SELECT traversal.status FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
          WHERE keyframe.id = OLD.keyframe_id) = 'complete'
    BEGIN SELECT RAISE(ABORT, 'observations of a complete traversal are never deleted'); END;
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
INSERT INTO alembic_version (version_num) VALUES ('0001');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings) VALUES (1, 1, 'monday', 'recordings/monday.mcap', 'fingerprint of monday', 1767603600000000000, 1767603610000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'complete', 1767603604000000000, '{"detect":1.5}');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings) VALUES (2, 2, 'tuesday', 'recordings/tuesday.mcap', 'fingerprint of tuesday', 1767603700000000000, 1767603710000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'complete', 1767603704000000000, '{"detect":1.5}');
INSERT INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom, config, versions, status, mapped_ns, timings) VALUES (3, 3, 'wednesday', 'recordings/wednesday.mcap', 'fingerprint of wednesday', 1767603800000000000, 1767603810000000000, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"keyframes":{"rate_hz":3.0}}', '{"supermap-cli":"0.1.0"}', 'building', 1767603801000000000, NULL);
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg) VALUES (1, 1, 1767603601000000000, 1, '[[1.0,0.0,0.0,2.5],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,2.5],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, X'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL);
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg) VALUES (2, 1, 1767603604000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, X'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL);
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg) VALUES (3, 2, 1767603701000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, X'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL);
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg) VALUES (4, 2, 1767603704000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, X'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL);
INSERT INTO keyframe (id, traversal_id, stamp_ns, detected, T_map_base, T_map_camera, camera, depth_step, depth_png, thumbnail_jpeg) VALUES (5, 3, 1767603801000000000, 1, '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '[[1.0,0.0,0.0,0.0],[0.0,1.0,0.0,0.0],[0.0,0.0,1.0,0.0],[0.0,0.0,0.0,1.0]]', '{"model": "pinhole", "width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 31.5, "cy": 23.5, "distortion": []}', 8, X'89504e470d0a1a0a0000000d49484452000000080000000610000000008bfe5c640000002249444154081d55c12101000000c230aedebf1991d06cd81c6c0e36079b83cdc1e60c23c30511c58304750000000049454e44ae426082', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (1, 'chair-1', 'chair', 'present', 3.0, 1767603601000000000, 1767603704000000000, 3.0, 2.0, 0.5, 3.0, 2.0, 0.5, 0.5, 0.5, 1.0, 0.0, 3, NULL, 1, '{"chair":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', X'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (2, 'dining-table-1', 'dining table', 'present', 3.0, 1767603601000000000, 1767603604000000000, 5.0, 5.0, 0.5, 5.0, 5.0, 0.5, 0.5, 0.5, 1.0, 0.0, 2, NULL, 1, '{"dining table":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', X'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (3, 'cup-1', 'cup', 'present', 3.0, 1767603604000000000, 1767603604000000000, 5.0, 5.0, 1.0, 5.0, 5.0, 1.0, 0.5, 0.5, 1.0, 0.0, 1, 2, 1, '{"cup":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', X'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
INSERT INTO instance (number, id, label, presence, existence_log_odds, first_seen_ns, last_seen_ns, x, y, z, center_x, center_y, center_z, size_x, size_y, size_z, yaw, observations, merged_into, traversal_id, label_belief, engine_state, voxels, embedding) VALUES (4, 'potted-plant-1', 'plant', 'present', 3.0, 1767603701000000000, 1767603801000000000, 0.0, 1.0, 0.6, 0.0, 1.0, 0.6, 0.5, 0.5, 1.0, 0.0, 2, NULL, 2, '{"plant":0.9,"other":0.1}', '{"label_logs":{"chair":-0.1},"unseen_log":-3.0,"looks":1.0,"viewpoints":{"1,1,1":2},"state_index":0,"state_first_seen_ns":1767603601000000000,"state_empty_before_ns":null,"gone_ns":null,"best_crop":0.0}', X'534d56317801ab1659e7feb06a8a3d330304300229262006f15980981588d980981d88398018081c10b8c19e810186415210d0000300c29f0b57', NULL);
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
