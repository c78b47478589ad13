"""Makes what was saved of a damaged map sound: values that nothing can read are replaced by what other rows say, and
rows that contradict the others go (`supermap db recover`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from sqlalchemy import Connection

from supermap_cli.errors import STUMBLES, SupermapError
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.memory import blobs
from supermap_cli.memory.depth_png import depth_shape
from supermap_cli.memory.invariants import INVARIANTS, KEYFRAMES_LOST
from supermap_cli.memory.stored_values import GREATEST, parsed_object, parsed_shares, parsed_texts, parsed_transform
from supermap_cli.memory.values import Problem
from supermap_cli.types.engine_state import EngineState
from supermap_cli.types.memory import VoxelCloud

Row = dict[str, Any]
_EDGE_M = 0.05
"""Metres; the voxel edge of a shape that is lost, which is empty."""
_JPEG = b"\xff\xd8\xff"
_PLACE = ("x", "y", "z", "center_x", "center_y", "center_z", "size_x", "size_y", "size_z", "yaw")
_LOST = 1e300
"""Stands for a coordinate that is lost, until another row tells it; larger than any that a row may hold."""
_FIT_M = 0.1
"""Metres between a thing's place and its newest state's, from where the former counts as damaged; the invariant of
merged maps has the same."""
_UNKNOWN_NS = 0
"""Of a span that nothing says; the keyframes say it later, if there are any."""
_NEWEST = """state s WHERE s.instance_number = instance.number
    ORDER BY s.state_index DESC LIMIT 1"""


def mended(table: str, row: Row) -> Row:
    """The row with values that can be read. Raises for a row that says nothing without those that cannot."""
    mend = _MENDED.get(table)
    return row if mend is None else mend(row)


def _or(read: Callable[[], Any], otherwise: Any, stored: Any) -> Any:
    """What is stored if it can be read, and otherwise something else."""
    try:
        read()
    except (SupermapError, *STUMBLES):
        return otherwise
    return stored


def _mended_traversal(row: Row) -> Row:
    """Everything of the map hangs on its traversals: of one only the id must be readable."""
    found = dict(row)
    for column in ("number", "start_ns", "end_ns"):
        if not isinstance(row[column], int):
            found[column] = int(row["id"]) if column == "number" else _UNKNOWN_NS
    found["clock_shift_ns"] = row["clock_shift_ns"] if isinstance(row["clock_shift_ns"], int) else 0
    for column in ("config", "versions"):
        found[column] = _or(lambda column=column: parsed_object(row[column], column), "{}", row[column])  # type: ignore[misc]
    if row["timings"] is not None:
        found["timings"] = _or(lambda: parsed_object(row["timings"], "timings"), None, row["timings"])
    found["T_map_odom"] = _or(
        lambda: parsed_transform(row["T_map_odom"], ""), json.dumps(np.eye(4).tolist()), row["T_map_odom"]
    )
    warnings = _or(lambda: parsed_texts(row["warnings"], ""), "[]", row["warnings"])
    for column in ("name", "recording", "fingerprint"):
        if not isinstance(row[column], str) or not row[column]:
            found[column] = f"recovered-{row['id']}"
    if row["status"] not in {"building", "complete"}:
        found["status"] = "complete"
    if found["start_ns"] > found["end_ns"]:
        found["start_ns"] = found["end_ns"] = _UNKNOWN_NS
    lost = [name for name in found if name != "warnings" and found[name] != row[name]]
    if warnings != row["warnings"]:
        lost.append("warnings")
    if lost:
        warnings = json.dumps([*json.loads(warnings), f"recovered from a damaged map without its {', '.join(lost)}"])
    return found | {"warnings": warnings}


def _mended_keyframe(row: Row) -> Row:
    """A keyframe whose camera, poses and depth can be read. Raises for others."""
    camera_from_json(row["camera"])
    depth_shape(row["depth_png"])
    for name in ("T_map_base", "T_map_camera"):
        parsed_transform(row[name], name)
    return row | {"thumbnail_jpeg": _image(row["thumbnail_jpeg"])}


def _mended_observation(row: Row) -> Row:
    """An observation whose label is one of its hypotheses; one of both tells the other."""
    label, first = row["label"], None
    try:
        hypotheses = json.loads(row["hypotheses"])
        first = hypotheses[0][0]
    except (*STUMBLES,):
        hypotheses = None
    if isinstance(label, str) and "\ufffd" in label and isinstance(first, str):
        row = row | {"label": first}
    elif first != label or not isinstance(hypotheses, list):
        row = row | {"hypotheses": json.dumps([[label, row["score"]]])}
    return row | {"crop_jpeg": _image(row["crop_jpeg"])}


def _mended_instance(row: Row) -> Row:
    """A thing whose shape, belief or place is lost has none: its states tell where it is."""
    found = dict(row)
    found["voxels"] = _or(lambda: blobs.decode_voxels(row["voxels"]), _no_voxels(), row["voxels"])
    if row["embedding"] is not None:
        found["embedding"] = _or(lambda: blobs.decode_embedding(row["embedding"]), None, row["embedding"])
    found["label_belief"] = _or(lambda: _check_belief(row), json.dumps({row["label"]: 1.0}), row["label_belief"])
    found["engine_state"] = _or(
        lambda: EngineState.of(parsed_object(row["engine_state"], "")),
        json.dumps(
            EngineState({row["label"]: 1.0}, 1.0, {}, 0, _int(row["first_seen_ns"]), None, None, 0.0).to_document()
        ),
        row["engine_state"],
    )
    for name in (*_PLACE, "existence_log_odds"):
        if not _is_finite(row[name]) or (name.startswith("size") and row[name] < 0):
            found[name] = 0.0 if name == "existence_log_odds" else _LOST
    for name in ("first_seen_ns", "last_seen_ns", "observations"):
        found[name] = _int(row[name])
    found["first_seen_ns"] = min(found["first_seen_ns"], found["last_seen_ns"])
    found["observations"] = max(found["observations"], 0)
    if row["presence"] not in {"present", "absent", "doubted"}:
        found["presence"] = "doubted"
    return found


def _mended_state(row: Row) -> Row:
    """A state whose place is lost may get its thing's; a lost confidence counts as none."""
    found = {name: row[name] if _is_finite(row[name]) else _LOST for name in _PLACE}
    sound = _is_finite(row["confidence"]) and 0 <= row["confidence"] <= 1
    return row | found | {"confidence": row["confidence"] if sound else 0.0}


def _check_belief(row: Row) -> None:
    shares = parsed_shares(row["label_belief"], "")
    if min(shares.values()) < 0 or abs(sum(shares.values()) - 1) > 1e-6:
        raise ValueError("no shares")


def _no_voxels() -> bytes:
    none = np.zeros(0, np.float32)
    return blobs.encode_voxels(
        VoxelCloud(_EDGE_M, np.zeros((0, 3), np.int32), none, none, none, np.zeros((0, 3), np.uint8))
    )


def _image(content: Any) -> bytes | None:
    return content if isinstance(content, bytes) and content.startswith(_JPEG) else None


def _int(value: Any) -> int:
    return value if isinstance(value, int) else _UNKNOWN_NS


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and abs(value) < GREATEST


_MENDED: dict[str, Callable[[Row], Row]] = {
    "traversal": _mended_traversal,
    "keyframe": _mended_keyframe,
    "observation": _mended_observation,
    "instance": _mended_instance,
    "state": _mended_state,
}

_SUPPORT = "SELECT min(k.stamp_ns), max(k.stamp_ns) FROM keyframe k WHERE k.traversal_id = traversal.id"
_MADE_ANEW = (
    # A thing's newest state lies where the thing does.
    f"""UPDATE state SET ({", ".join(_PLACE)}) = (SELECT {", ".join(f"i.{name}" for name in _PLACE)} FROM instance i
        WHERE i.number = state.instance_number) WHERE ({" + ".join(_PLACE)}) > {GREATEST} AND EXISTS (
        SELECT 1 FROM instance i WHERE i.number = state.instance_number
        AND {" + ".join(f"i.{name}" for name in _PLACE)} < {GREATEST})
        AND state_index = (SELECT max(n.state_index) FROM state n WHERE n.instance_number = state.instance_number)""",  # noqa: S608
    # Times, places and labels of things are those of their states.
    f"""UPDATE instance SET ({", ".join(_PLACE)}, label) = (SELECT {", ".join(f"s.{name}" for name in _PLACE)}, s.label
        FROM {_NEWEST}) WHERE merged_into IS NULL AND EXISTS (SELECT 1 FROM state s WHERE
        s.instance_number = instance.number) AND ({{wrong}})""",  # noqa: S608
    """UPDATE instance SET label_belief = json_object(label, 1.0)
       WHERE NOT EXISTS (SELECT 1 FROM json_each(label_belief) WHERE key = instance.label)""",
    """UPDATE instance SET first_seen_ns = (SELECT min(first_seen_ns) FROM state s WHERE s.instance_number = number),
       last_seen_ns = (SELECT max(last_seen_ns) FROM state s WHERE s.instance_number = number)
       WHERE merged_into IS NULL AND EXISTS (SELECT 1 FROM state s WHERE s.instance_number = number)""",
    f"""UPDATE instance SET presence = CASE WHEN (SELECT s.gone_ns FROM {_NEWEST}) IS NULL THEN 'present' ELSE 'absent'
        END WHERE merged_into IS NULL AND presence <> 'doubted'""",  # noqa: S608
    # What was seen of a thing is what is left of its observations.
    """INSERT OR IGNORE INTO visit SELECT k.traversal_id, o.instance_number, count(DISTINCT k.id), count(DISTINCT k.id),
       0, min(k.stamp_ns), max(k.stamp_ns) FROM observation o JOIN keyframe k ON k.id = o.keyframe_id
       JOIN instance i ON i.number = o.instance_number GROUP BY k.traversal_id, o.instance_number""",
    # A state follows the one before it by a change.
    """INSERT INTO temporal_edge (kind, from_number, from_state, to_number, to_state, not_before_ns, not_after_ns,
       probability, distance_m, traversal_id)
       SELECT 'moved', a.instance_number, a.state_index, b.instance_number, b.state_index, a.last_seen_ns,
       b.first_seen_ns, 0, NULL, b.traversal_id FROM state a JOIN state b ON b.instance_number = a.instance_number
       AND b.state_index = a.state_index + 1 WHERE a.last_seen_ns <= b.first_seen_ns AND NOT EXISTS (
       SELECT 1 FROM temporal_edge e WHERE e.to_number = b.instance_number AND e.to_state = b.state_index)""",
)


_GIVEN_UP = tuple(invariant for invariant in INVARIANTS if "none was given up" in invariant.rule)
"""Broken where observations are lost of which nothing is left that could be counted."""


def make_spans(connection: Connection) -> None:
    """A traversal that has keyframes and none of them within its span, or that has none, spans its keyframes."""
    connection.exec_driver_sql(
        f"""UPDATE traversal SET (start_ns, end_ns) = ({_SUPPORT}) WHERE EXISTS (
            SELECT 1 FROM keyframe k WHERE k.traversal_id = traversal.id) AND NOT EXISTS (SELECT 1 FROM keyframe k
            WHERE k.traversal_id = traversal.id AND k.stamp_ns BETWEEN start_ns AND end_ns)"""  # noqa: S608
    )


def make_traversals(connection: Connection) -> int:
    """A traversal whose row is lost is one again if anything was seen in it. Returns how many."""
    return connection.exec_driver_sql(
        """INSERT OR IGNORE INTO traversal (id, number, name, recording, fingerprint, start_ns, end_ns, T_map_odom,
           config, versions, status, warnings)
           SELECT traversal_id, traversal_id, 'recovered-' || traversal_id, 'unknown', 'unknown', min(first_ns),
           max(last_ns), '[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]', '{}', '{}', 'complete',
           '["recovered from a damaged map that had lost everything of this traversal but what was seen in it"]'
           FROM (SELECT traversal_id, stamp_ns AS first_ns, stamp_ns AS last_ns FROM keyframe
                 UNION ALL SELECT traversal_id, first_seen_ns, last_seen_ns FROM instance
                 UNION ALL SELECT traversal_id, first_seen_ns, last_seen_ns FROM state)
           WHERE traversal_id NOT IN (SELECT id FROM traversal) GROUP BY traversal_id"""
    ).rowcount


def make_anew(connection: Connection, *, observations_lost: bool) -> None:
    """What rows of a recovered map say of one another, and warnings of what is lost."""
    wrong = " OR ".join(
        f"abs(instance.{name} - (SELECT s.{name} FROM {_NEWEST})) > {_FIT_M}"  # noqa: S608 - columns of the schema
        for name in _PLACE[:9]
    )
    wrong += f" OR instance.label <> (SELECT s.label FROM {_NEWEST})"  # noqa: S608
    for statement in _MADE_ANEW:
        connection.exec_driver_sql(statement.replace("{wrong}", wrong))
    keyframes_lost = connection.exec_driver_sql(_KEYFRAMES_LOST).rowcount > 0
    missed = (connection.exec_driver_sql(invariant.violations).first() is not None for invariant in _GIVEN_UP)
    if observations_lost or keyframes_lost or any(missed):
        connection.exec_driver_sql(
            """UPDATE traversal SET observations_kept_from_ns = end_ns + 1
               WHERE status = 'complete' AND end_ns < 9223372036854775807"""
        )


_KEYFRAMES_LOST = f"""UPDATE traversal SET warnings = json_insert(warnings, '$[#]', '{KEYFRAMES_LOST}')
    WHERE warnings NOT LIKE '%{KEYFRAMES_LOST}%' AND EXISTS (SELECT 1 FROM state s, (SELECT s.id FROM state s
    WHERE s.first_seen_ns NOT IN (SELECT stamp_ns FROM keyframe)
    OR s.last_seen_ns NOT IN (SELECT stamp_ns FROM keyframe)) lost
    WHERE lost.id = s.id AND (s.first_seen_ns BETWEEN start_ns AND end_ns
    OR s.last_seen_ns BETWEEN start_ns AND end_ns))"""  # noqa: S608 - constants of this module
_OF_INSTANCE = "(SELECT i.id FROM instance i WHERE i.number = {}.{})"
_RUN = "(SELECT t.name FROM traversal t WHERE t.id = {}.traversal_id)"
_NAMES = {
    "instance": ("id", "CAST(number AS TEXT)"),
    "state": ("CAST(id AS TEXT)", f"{_OF_INSTANCE.format('state', 'instance_number')} || ' state ' || state_index"),
    "visit": (f"{_OF_INSTANCE.format('visit', 'instance_number')} || ' in ' || {_RUN.format('visit')}",),
    "spatial_edge": (
        "CAST(id AS TEXT)",
        (
            f"{_OF_INSTANCE.format('spatial_edge', 'subject_number')} || ' ' || relation || ' ' || "
            f"{_OF_INSTANCE.format('spatial_edge', 'object_number')} || ' since ' || since_ns"
        ),
    ),
    "temporal_edge": (
        "CAST(id AS TEXT)",
        (
            f"kind || ' ' || {_OF_INSTANCE.format('temporal_edge', 'from_number')} || ' ' || "
            f"{_OF_INSTANCE.format('temporal_edge', 'to_number')} || ' at ' || not_after_ns"
        ),
    ),
    "keyframe": (
        "CAST(id AS TEXT)",
        "(SELECT t.name FROM traversal t WHERE t.id = keyframe.traversal_id) || ' ' || stamp_ns",
    ),
    "observation": ("CAST(id AS TEXT)",),
    "traversal": ("name",),
    "before_image": ("CAST(row_key AS TEXT)",),
}
"""How the problems of a table name its rows (`Problem.row`), in SQL."""


def drop_named(connection: Connection, problems: list[Problem]) -> dict[str, int]:
    """Delete the rows that problems name; a traversal's only when nothing else is wrong. Returns how many, by table."""
    named: dict[str, set[str]] = {}
    for problem in problems:
        if problem.table in _NAMES and problem.row != "?":
            named.setdefault(problem.table, set()).add(problem.row)
    if len(named) > 1:
        named.pop("traversal", None)
    return {table: _drop_rows(connection, table, rows) for table, rows in named.items()}


def _drop_rows(connection: Connection, table: str, rows: set[str]) -> int:
    count = 0
    names = json.dumps(sorted(rows))
    for name in _NAMES[table]:
        statement = f"DELETE FROM {table} WHERE {name} IN (SELECT value FROM json_each(?))"  # noqa: S608
        count += connection.exec_driver_sql(statement, (names,)).rowcount
    return count
