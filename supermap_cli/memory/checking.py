"""Verifies the map's invariants and reports violations (`supermap db check`)."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from sqlalchemy import Connection, func, select, text
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import STUMBLES, CalibrationError, MemoryStoreError
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.memory import blobs
from supermap_cli.memory.checksums import changed_rows, sums_without_rows
from supermap_cli.memory.databases import Dialect, dialect_of, is_no_damage
from supermap_cli.memory.depth_png import depth_shape
from supermap_cli.memory.invariants import INVARIANTS
from supermap_cli.memory.names import clean_text
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.stale_edges import stale_edges
from supermap_cli.memory.values import Invariant, Problem
from supermap_cli.printable import printable
from supermap_cli.types.engine_state import EngineState
from supermap_schema import models
from supermap_schema.checksums import IMMUTABLE
from supermap_schema.views import VIEW_NAMES

_TEXT_ID = re.compile(r"[^\W_]+(-[^\W_]+)*-[1-9][0-9]*")
_TOLERANCE = 1e-6
"""Of sums of probabilities and of rotation matrices that were stored as text."""
_ROWS = 2000
"""Rows checked together."""

Check = Callable[[Connection], Iterator[Problem]]


def check(reader: MapReader) -> list[Problem]:
    """Every broken invariant of the map. Whatever damage there is ends no check but the one that meets it."""
    return problems_of(reader.connection)


def problems_of(connection: Connection) -> list[Problem]:
    """`check` within a transaction that is open already."""
    dialect = dialect_of(connection)
    problems = list(_surviving("schema", connection, lambda each: _missing(each, dialect)))
    if any(problem.row in models.Base.metadata.tables for problem in problems):
        return problems
    problems += _surviving("file", connection, dialect.damage)
    for invariant in (*INVARIANTS, *dialect.invariants):
        problems += _violations(connection, invariant)
    checks: tuple[tuple[str, Check], ...] = (
        ("traversal", _traversal_problems),
        ("keyframe", _keyframe_problems),
        ("observation", _observation_problems),
        ("instance", _instance_problems),
        ("transform", _transform_problems),
        ("spatial_edge", _edge_problems),
        ("checksum", sums_without_rows),
        *((name, partial(changed_rows, table=name)) for name in IMMUTABLE),
    )
    return problems + [problem for name, rows in checks for problem in _surviving(name, connection, rows)]


def _surviving(table: str, connection: Connection, check_rows: Check) -> Iterator[Problem]:
    """The problems that a check finds; where it cannot go on, that is one, too."""
    try:
        with connection.begin_nested():
            yield from check_rows(connection)
    except (DatabaseError, *STUMBLES) as error:
        if is_no_damage(error):
            raise
        yield Problem(table, "?", f"cannot be read to its end: {getattr(error, 'orig', None) or error}")


def _edge_problems(connection: Connection) -> Iterator[Problem]:
    for edge in stale_edges(connection):
        yield Problem("spatial_edge", edge.name, "goes on although its ends stand too far apart for it")


def _of_row(table: str, name: object, check_row: Callable[[], Iterator[Problem]]) -> Iterator[Problem]:
    """The problems of one row; that it cannot be understood is one."""
    try:
        yield from list(check_row())
    except (MemoryStoreError, *STUMBLES) as error:
        what = error.what if isinstance(error, MemoryStoreError) else f"{type(error).__name__}: {error}"
        yield Problem(table, str(name), f"cannot be understood: {what}")


def _missing(connection: Connection, dialect: Dialect) -> Iterator[Problem]:
    """Missing or changed tables, indices, views and triggers; the other checks rely on them."""
    tables = models.Base.metadata.sorted_tables
    indices = [str(index.name) for table in tables for index in table.indexes]
    found = dialect.objects(connection)
    for name in (*(table.name for table in tables), *indices, *VIEW_NAMES, *dialect.own_objects):
        if name not in found:
            yield Problem("schema", name, "is missing or switched off")
    for name in sorted(dialect.altered(connection)):
        yield Problem("schema", name, "is not what the schema makes under this name")


def _violations(connection: Connection, invariant: Invariant) -> Iterator[Problem]:
    """Violations of one invariant; an error of the query itself (a damaged table) is reported as a problem."""
    try:
        with connection.begin_nested():
            for (row,) in connection.execute(text(invariant.violations)):
                yield Problem(invariant.table, str(row), invariant.rule)
    except DatabaseError as error:
        if is_no_damage(error):
            raise
        yield Problem(invariant.table, "?", f"cannot be checked ({error.orig}), whether any {invariant.rule}")


def _traversal_problems(connection: Connection) -> Iterator[Problem]:
    """JSON columns of traversals that are no objects or lists, and texts that are none."""
    traversal = models.Traversal
    columns = select(
        *(traversal.name, traversal.recording, traversal.config, traversal.versions, traversal.timings),
        traversal.warnings,
    )
    for row in connection.execute(columns.order_by(traversal.number)):
        yield from _of_row("traversal", row.name, lambda row=row: _problems_of_traversal(row))  # type: ignore[misc]


def _problems_of_traversal(row: Any) -> Iterator[Problem]:
    yield from _text_problems("traversal", row.name, name=row.name, recording=row.recording)
    if not _is_list_of_texts(_json(row.warnings)):
        yield Problem("traversal", row.name, "has warnings that are no JSON list of texts")
    for column in ("config", "versions", "timings"):
        document = getattr(row, column)
        if document is not None and not isinstance(_json(document), dict):
            yield Problem("traversal", row.name, f"has a {column} that is no JSON object")


def _text_problems(table: str, row: object, **texts: object) -> Iterator[Problem]:
    """Texts with NUL, with control characters, or that are no UTF-8."""
    for column, value in texts.items():
        if not isinstance(value, str) or clean_text(value) != value:
            yield Problem(table, printable(str(row)), f"has a {column} that holds control characters or is no text")


def _keyframe_problems(connection: Connection) -> Iterator[Problem]:
    """Keyframes with a damaged camera, or a depth image that does not have one pixel for every `depth_step` pixels."""
    keyframe = models.Keyframe
    statement = select(keyframe.id, keyframe.camera, keyframe.camera_id, keyframe.depth_step, keyframe.depth_png)
    found = connection.execute(statement.order_by(keyframe.id).execution_options(yield_per=_ROWS // 10))
    for row in found:
        yield from _of_row("keyframe", row.id, lambda row=row: _problems_of_keyframe(row))  # type: ignore[misc]


def _problems_of_keyframe(row: Any) -> Iterator[Problem]:
    camera = shape = None
    yield from _text_problems("keyframe", row.id, camera_id=row.camera_id)
    try:
        camera = camera_from_json(row.camera)
    except CalibrationError as error:
        yield Problem("keyframe", str(row.id), f"has a camera that is none: {error.what}")
    try:
        shape = depth_shape(row.depth_png)
    except MemoryStoreError as error:
        yield Problem("keyframe", str(row.id), f"has a depth_png that {error.what}")
    if camera is not None and shape is not None:
        expected = (-(-camera.height // row.depth_step), -(-camera.width // row.depth_step))
        if shape != expected:
            yield Problem("keyframe", str(row.id), f"has a depth_png of {shape}, not {expected} pixels (h, w)")


def _observation_problems(connection: Connection) -> Iterator[Problem]:
    """Labels that are no text, each named at its first observation; the dialects' invariants look at the hypotheses."""
    observation = models.Observation
    labels = select(func.min(observation.id).label("id"), observation.label).group_by(observation.label)
    for row in connection.execute(labels.order_by(func.min(observation.id))):
        yield from _text_problems("observation", row.id, label=row.label)


def _instance_problems(connection: Connection) -> Iterator[Problem]:
    instance = models.Instance
    statement = select(
        *(instance.id, instance.label, instance.merged_into, instance.label_belief, instance.engine_state),
        *(instance.voxels, instance.embedding),
    ).order_by(instance.number)
    for row in connection.execute(statement.execution_options(yield_per=_ROWS // 10)):
        yield from _of_row("instance", row.id, lambda row=row: _problems_of_instance(row))  # type: ignore[misc]


def _problems_of_instance(row: Any) -> Iterator[Problem]:
    if not _TEXT_ID.fullmatch(row.id):
        yield Problem("instance", row.id, "has an id that is no label and number")
    yield from _text_problems("instance", row.id, label=row.label)
    belief = _json(row.label_belief)
    if not _is_belief(belief):
        yield Problem("instance", row.id, "has a label belief that is no shares that sum to 1")
    elif row.label not in belief:
        yield Problem("instance", row.id, "has a label that its label belief does not know")
    try:
        if row.merged_into is None:
            EngineState.of(_json(row.engine_state))
        blobs.decode_voxels(row.voxels)
        if row.embedding is not None:
            blobs.decode_embedding(row.embedding)
    except MemoryStoreError as error:
        yield Problem("instance", row.id, error.what)


def _is_list_of_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(text, str) for text in value)


def _is_belief(shares: Any) -> bool:
    try:
        return bool(min(shares.values()) >= 0 and abs(sum(shares.values()) - 1) < _TOLERANCE)
    except (ValueError, TypeError, AttributeError):
        return False


def _json(document: str) -> Any:
    """The parsed document; `None` if it is no JSON."""
    try:
        return json.loads(document)
    except (ValueError, TypeError, RecursionError):
        return None


def _transform_problems(connection: Connection) -> Iterator[Problem]:
    for model, column in (
        (models.Traversal, models.Traversal.T_map_odom),
        (models.Keyframe, models.Keyframe.T_map_base),
        (models.Keyframe, models.Keyframe.T_map_camera),
    ):
        statement = select(model.id, column.label("transform")).order_by(model.id)
        found = connection.execute(statement.execution_options(yield_per=_ROWS))
        for rows in found.partitions():
            for row in _not_rigid(rows):
                yield Problem(model.__tablename__, str(row), f"has a {column.name} that is no rigid transform")


def _not_rigid(rows: Sequence[Any]) -> Iterator[int]:
    """The ids of rows with a broken transform. Rows are parsed together, and one by one only if that fails."""
    try:
        T = np.array(json.loads(f"[{','.join(row.transform for row in rows)}]"), np.float64).reshape(len(rows), 4, 4)
    except (ValueError, TypeError, OverflowError, RecursionError):
        if len(rows) == 1:
            yield rows[0].id
        else:
            for row in rows:
                yield from _not_rigid([row])
        return
    R = T[:, :3, :3]
    off = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2)) + np.abs(T[:, 3] - [0, 0, 0, 1]).max(axis=1)
    rigid = (off < _TOLERANCE) & (np.linalg.det(R) > 0) & np.isfinite(T).all(axis=(1, 2))
    yield from (row.id for row, sound in zip(rows, rigid, strict=True) if not sound)
