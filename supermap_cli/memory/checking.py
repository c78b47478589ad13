"""Verifies the map's invariants and reports violations (`supermap db check`)."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from sqlalchemy import Connection, select, text
from sqlalchemy.exc import DatabaseError

from supermap_cli.errors import CalibrationError, MemoryStoreError
from supermap_cli.geometry.cameras import camera_from_json
from supermap_cli.memory import blobs
from supermap_cli.memory.databases import Dialect, dialect_of
from supermap_cli.memory.depth_png import depth_shape
from supermap_cli.memory.invariants import INVARIANTS
from supermap_cli.memory.reading import MapReader
from supermap_cli.memory.values import Invariant, Problem
from supermap_cli.types.engine_state import EngineState
from supermap_schema import models
from supermap_schema.views import VIEW_NAMES

_TEXT_ID = re.compile(r"[^\W_]+(-[^\W_]+)*-[1-9][0-9]*")
_TOLERANCE = 1e-6
"""Of sums of probabilities and of rotation matrices that were stored as text."""
_ROWS = 2000
"""Rows checked together."""


def check(reader: MapReader) -> list[Problem]:
    """Every broken invariant of the map."""
    connection = reader.connection
    dialect = dialect_of(connection)
    problems = list(_missing(connection, dialect))
    if any(problem.row in models.Base.metadata.tables for problem in problems):
        return problems
    problems += dialect.damage(connection)
    for invariant in (*INVARIANTS, *dialect.invariants):
        problems += _violations(connection, invariant)
    checks = (_traversal_problems, _keyframe_problems, _instance_problems, _transform_problems)
    return problems + [problem for check_rows in checks for problem in check_rows(connection)]


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
        yield Problem(invariant.table, "?", f"cannot be checked ({error.orig}), whether any {invariant.rule}")


def _traversal_problems(connection: Connection) -> Iterator[Problem]:
    """JSON columns of traversals that are no objects or lists."""
    traversal = models.Traversal
    columns = select(traversal.name, traversal.config, traversal.versions, traversal.timings, traversal.warnings)
    for name, *documents, warnings in connection.execute(columns.order_by(traversal.number)):
        if not _is_list_of_texts(_json(warnings)):
            yield Problem("traversal", name, "has warnings that are no JSON list of texts")
        for column, document in zip(("config", "versions", "timings"), documents, strict=True):
            if document is not None and not isinstance(_json(document), dict):
                yield Problem("traversal", name, f"has a {column} that is no JSON object")


def _keyframe_problems(connection: Connection) -> Iterator[Problem]:
    """Keyframes with a damaged camera, or a depth image that does not have one pixel for every `depth_step` pixels."""
    keyframe = models.Keyframe
    statement = select(keyframe.id, keyframe.camera, keyframe.depth_step, keyframe.depth_png).order_by(keyframe.id)
    for row in connection.execute(statement.execution_options(yield_per=_ROWS // 10)):
        camera = shape = None
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


def _instance_problems(connection: Connection) -> Iterator[Problem]:
    instance = models.Instance
    statement = select(
        *(instance.id, instance.label, instance.merged_into, instance.label_belief, instance.engine_state),
        *(instance.voxels, instance.embedding),
    ).order_by(instance.number)
    for row in connection.execute(statement.execution_options(yield_per=_ROWS)):
        if not _TEXT_ID.fullmatch(row.id):
            yield Problem("instance", row.id, "has an id that is no label and number")
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
    except ValueError:
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
    except (ValueError, TypeError):
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
