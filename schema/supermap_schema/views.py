"""Readable views in portable SQL; the functions that differ between databases are passed in (`SqlFunctions`).

Every time has two columns: nanoseconds (`*_ns`), and under the same name without `_ns` a text: UTC, or seconds since
the start of the map if its clocks were never set. Both are the map's time; a recording's own differs from it by
`traversal.clock_shift_ns`, usually 0. Instances and traversals are given by name. Metres, radians and probabilities are
rounded to thousandths; the tables have all digits. The views of a released version are never edited (those of the first
version are in `sqlite`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

WALL_TIME_NS = 946_684_800 * 10**9
"""2000-01-01 in nanoseconds since the epoch; earlier stamps come from clocks that were never set."""

FOUND_AGAIN = """EXISTS (SELECT 1 FROM temporal_edge AS move WHERE move.kind = 'moved'
        AND move.from_number = edge.from_number AND move.from_state = edge.from_state)"""

VIEW_NAMES = ("current_objects", "object_history", "changes", "relations", "trajectory")


@dataclass(frozen=True)
class SqlFunctions:
    """SQL functions that differ between databases; all of them return NULL for NULL.

    `utc` formats a column of nanoseconds as "2026-01-05T09:00:00.0Z", `seconds` an expression in nanoseconds as
    "12.3 s". `rounded` rounds to thousandths. `element` takes (transform as JSON, row, column). `joined` concatenates
    texts with commas: (expression, order).
    """

    utc: Callable[[str], str]
    seconds: Callable[[str], str]
    rounded: Callable[[str], str]
    element: Callable[[str, int, int], str]
    joined: Callable[[str, str], str]

    def time(self, column: str, name: str | None = None) -> str:
        """The column `<name>_ns` as a text column `<name>`, or with another name."""
        origin = "(SELECT min(start_ns) FROM traversal)"
        name = name or column.rpartition(".")[2].removesuffix("_ns")
        return (
            f"CASE WHEN {origin} >= {WALL_TIME_NS} THEN {self.utc(column)} "
            f"ELSE {self.seconds(f'{column} - {origin}')} END AS {name}"
        )

    def reals(self, *columns: str) -> str:
        """Rounded columns with their own names, or with another one given as "column AS name"."""
        pairs = ((column.partition(" AS ")[0], column.rpartition(" AS ")[2].rpartition(".")[2]) for column in columns)
        return ", ".join(f"{self.rounded(column)} AS {name}" for column, name in pairs)


def views_0002(sql: SqlFunctions) -> tuple[str, ...]:
    """The statements that create the views of the second version; none of these views may exist."""
    return (
        _current_objects(sql),
        _object_history(sql),
        _changes(sql),
        _relations(sql),
        _trajectory(sql),
    )


def _current_objects(sql: SqlFunctions) -> str:
    """One row for every present object; `since` is when it was first seen in its current place."""
    return f"""
    CREATE VIEW current_objects AS
    SELECT instance.id, instance.label, {sql.reals("state.confidence")},
           {sql.reals("instance.x", "instance.y", "instance.z")},
           {sql.reals("instance.size_x", "instance.size_y", "instance.size_z", "instance.yaw")},
           (SELECT {sql.joined("edge.relation || ' ' || other.id", "edge.relation, edge.object_number")}
            FROM spatial_edge AS edge JOIN instance AS other ON other.number = edge.object_number
            WHERE edge.subject_number = instance.number AND edge.until_ns IS NULL
            AND edge.relation <> 'near') AS stands,
           {sql.time("instance.first_seen_ns")}, {sql.time("instance.last_seen_ns")},
           {sql.time("state.first_seen_ns", "since")},
           first_traversal.name AS first_traversal,
           (SELECT traversal.name FROM visit JOIN traversal ON traversal.id = visit.traversal_id
            WHERE visit.instance_number = instance.number AND visit.supported > 0
            ORDER BY visit.traversal_id DESC LIMIT 1) AS last_traversal,
           instance.observations, instance.first_seen_ns, instance.last_seen_ns, state.first_seen_ns AS since_ns
    FROM instance JOIN traversal AS first_traversal ON first_traversal.id = instance.traversal_id
    LEFT JOIN state ON state.instance_number = instance.number AND state.state_index =
        (SELECT max(newest.state_index) FROM state AS newest WHERE newest.instance_number = instance.number)
    WHERE instance.presence = 'present' AND instance.merged_into IS NULL
    ORDER BY instance.number
    """  # noqa: S608 - all parts are constants of this file


def _object_history(sql: SqlFunctions) -> str:
    """One row for every state of every object, with its place and its times.

    `presence` is the object's in its newest state, "ended" in earlier ones, "merged" if it was merged into another
    (`merged_into`); `moved_m` is the distance of the move that led to the state.
    """
    return f"""
    CREATE VIEW object_history AS
    SELECT instance.id, state.state_index, state.label,
           CASE WHEN instance.merged_into IS NOT NULL THEN 'merged'
                WHEN state.state_index = (SELECT max(newest.state_index) FROM state AS newest
                                          WHERE newest.instance_number = state.instance_number)
                THEN instance.presence ELSE 'ended' END AS presence,
           {sql.reals("state.confidence", "state.x", "state.y", "state.z")},
           (SELECT {sql.rounded("max(edge.distance_m)")} FROM temporal_edge AS edge
            WHERE edge.to_number = state.instance_number AND edge.to_state = state.state_index
            AND edge.kind = 'moved') AS moved_m,
           {sql.time("state.empty_before_ns")}, {sql.time("state.first_seen_ns")},
           {sql.time("state.last_seen_ns")}, {sql.time("state.gone_ns")},
           traversal.name AS first_traversal,
           (SELECT survivor.id FROM instance AS survivor WHERE survivor.number = instance.merged_into) AS merged_into,
           state.empty_before_ns, state.first_seen_ns, state.last_seen_ns, state.gone_ns
    FROM state JOIN instance ON instance.number = state.instance_number
    JOIN traversal ON traversal.id = state.traversal_id
    ORDER BY state.instance_number, state.state_index
    """  # noqa: S608 - all parts are constants of this file


def _changes(sql: SqlFunctions) -> str:
    """One row for every change, with its two places and the bounds of its time.

    `from_id` and `to_id` differ for changes between two objects: merged, split, candidate. An object that disappeared
    and was then found elsewhere has moved, and has one row only.
    """
    return f"""
    CREATE VIEW changes AS
    SELECT edge.kind, target.id, target.label,
           {sql.reals("before.x AS from_x", "before.y AS from_y", "before.z AS from_z")},
           {sql.reals("after.x AS to_x", "after.y AS to_y", "after.z AS to_z", "edge.distance_m")},
           {sql.time("edge.not_before_ns")}, {sql.time("edge.not_after_ns")},
           traversal.name AS traversal, {sql.reals("edge.probability")},
           source.id AS from_id, edge.from_state, target.id AS to_id, edge.to_state,
           edge.not_before_ns, edge.not_after_ns
    FROM temporal_edge AS edge JOIN instance AS source ON source.number = edge.from_number
    JOIN instance AS target ON target.number = edge.to_number
    JOIN traversal ON traversal.id = edge.traversal_id
    LEFT JOIN state AS before ON before.instance_number = edge.from_number AND before.state_index = edge.from_state
    LEFT JOIN state AS after ON after.instance_number = edge.to_number AND after.state_index = edge.to_state
        AND edge.kind <> 'disappeared'
    WHERE edge.kind <> 'persisted' AND NOT (edge.kind = 'disappeared' AND {FOUND_AGAIN})
    ORDER BY edge.not_after_ns, edge.id
    """  # noqa: S608 - all parts are constants of this file


def _relations(sql: SqlFunctions) -> str:
    """One row for every relation and its interval; `until` is NULL while it holds."""
    return f"""
    CREATE VIEW relations AS
    SELECT subject.id AS subject, edge.relation, object.id AS object,
           subject.label AS subject_label, object.label AS object_label,
           {sql.time("edge.since_ns")}, {sql.time("edge.until_ns")},
           {sql.reals("edge.confidence")}, traversal.name AS traversal, edge.since_ns, edge.until_ns
    FROM spatial_edge AS edge JOIN instance AS subject ON subject.number = edge.subject_number
    JOIN instance AS object ON object.number = edge.object_number
    JOIN traversal ON traversal.id = edge.traversal_id
    ORDER BY edge.id
    """  # noqa: S608 - all parts are constants of this file


def _trajectory(sql: SqlFunctions) -> str:
    """One row for every keyframe with the robot's position."""
    return f"""
    CREATE VIEW trajectory AS
    SELECT traversal.name AS traversal, {sql.time("keyframe.stamp_ns", "at")},
           {sql.reals(*_robot_position(sql))}, keyframe.stamp_ns
    FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
    ORDER BY traversal.number, keyframe.stamp_ns
    """  # noqa: S608 - all parts are constants of this file


def trajectory_0003(sql: SqlFunctions) -> tuple[str, ...]:
    """The statements that replace the trajectory view: one row for every keyframe, with its camera's name."""
    return (
        "DROP VIEW trajectory",
        f"""
    CREATE VIEW trajectory AS
    SELECT traversal.name AS traversal, {sql.time("keyframe.stamp_ns", "at")},
           {sql.reals(*_robot_position(sql))}, keyframe.camera_id, keyframe.stamp_ns
    FROM keyframe JOIN traversal ON traversal.id = keyframe.traversal_id
    ORDER BY traversal.number, keyframe.stamp_ns, keyframe.camera_id
    """,  # noqa: S608 - all parts are constants of this file
    )


def _robot_position(sql: SqlFunctions) -> Iterator[str]:
    """The translation of `T_map_base` as columns x, y, z."""
    return (f"{sql.element('keyframe.T_map_base', row, 3)} AS {axis}" for row, axis in enumerate("xyz"))
