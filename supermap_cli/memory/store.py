"""`MapStore`: reads and writes the map database as values. Only this package opens database sessions."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from sqlalchemy import Connection, Engine, Row, Select, delete, func, insert, select, update
from sqlalchemy.exc import DatabaseError, IntegrityError

from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory import rows
from supermap_cli.memory.databases import Database, Lock, dialect_of
from supermap_cli.memory.map_import import MapImport, import_map
from supermap_cli.memory.names import traversal_name
from supermap_cli.memory.numbers import BATCH
from supermap_cli.memory.pruning import (
    Progress,
    PruneCounts,
    PrunePolicy,
    declare_limits,
    prune_observations,
    prune_thumbnails,
)
from supermap_cli.memory.reading import MapReader, select_traversals
from supermap_cli.memory.repairing import repair
from supermap_cli.memory.rollback import drop_before_images, roll_back
from supermap_cli.memory.stored_values import damaged, parsed_object
from supermap_cli.memory.values import Checkpoint, StoredTraversal, TraversalStart
from supermap_cli.memory.writing import measure_moves, write_checkpoint, write_delta
from supermap_cli.types.memory import InstanceRecord, KeyframeRecord, MapDelta, SpatialEdge, StateRecord, Visit
from supermap_schema import models
from supermap_schema.checksums import store_sums

if TYPE_CHECKING:
    from supermap_cli.geometry.arrays import FloatArray


class MapStore:
    """An open map database, made by `opening.open_store`; `close` it, or use it in a `with` statement.

    A build calls `begin_traversal`, then `commit` for every batch of keyframes, then `finish_traversal`, or
    `discard_traversal` if it has no result. A build that was stopped leaves an `unfinished` traversal, which is resumed
    from its `checkpoint` or rolled back. Queries use `reader`.
    """

    def __init__(self, database: Database, engine: Engine | None, lock: Lock | None) -> None:
        """`engine` is `None` until the map exists; `lock` is `None` for readers."""
        self._database = database
        self._engine = engine
        self._lock = lock
        self._created = False

    @property
    def where(self) -> str:
        """The map's path, or its URL without the password."""
        return self._database.where

    @property
    def identity(self) -> str:
        """Equal for equal maps, however their path or URL is written."""
        return self._database.identity

    @property
    def file(self) -> Path | None:
        """The file of an SQLite map; `None` for a map on a server."""
        return self._database.file

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close all connections and release the build lock."""
        if self._engine is not None:
            self._engine.dispose()
        if self._lock is not None:
            self._lock.release()

    # Building

    def unfinished(self) -> StoredTraversal | None:
        """The traversal whose build was stopped or killed. While this store holds the lock, no build is running."""
        return next((traversal for traversal in self.traversals() if traversal.status == "building"), None)

    def roll_back_unfinished(self) -> tuple[str, ...]:
        """Roll back the traversals of stopped builds, and return their names."""
        unfinished = [traversal for traversal in self.traversals() if traversal.status == "building"]
        if unfinished:
            with self._writing() as connection:
                for traversal in unfinished:
                    roll_back(connection, traversal.id)
        return tuple(traversal.name for traversal in unfinished)

    def check_is_new(
        self, recording: str, fingerprint: str, name: str | None, *, again: bool = False, without: int | None = None
    ) -> None:
        """Raise `MemoryStoreError` if a recording is in the map already, unless `again`, or if the name is taken.

        The traversal with the id `without` is ignored: it is about to be rolled back.
        """
        known = [traversal for traversal in self.traversals() if traversal.id != without]
        same = next((known_object.name for known_object in known if known_object.fingerprint == fingerprint), None)
        if same is not None and not again:
            raise MemoryStoreError(
                f"this recording is in the map already, as traversal {same!r}",
                where=recording,
                cure="build another recording, or this one into a database of its own (--db), or once more (--again)",
            )
        if name is not None and name in {known_object.name for known_object in known}:
            raise MemoryStoreError(
                f"there is a traversal named {name!r} already", where=self.where, cure="choose another name"
            )

    def begin_traversal(self, start: TraversalStart, *, again: bool = False) -> int:
        """Add a traversal and return its id; a missing map is created.

        Raises `MemoryStoreError` if the recording is in the map already, unless `again`, if its name is taken, or if
        the build of another traversal is unfinished.
        """
        self._create_if_missing()
        if (unfinished := self.unfinished()) is not None:
            raise MemoryStoreError(
                f"the build of {unfinished.name!r} has not come to its end",
                where=self.where,
                cure="let it go on, or take out what it wrote",
            )
        self.check_is_new(start.recording, start.fingerprint, start.name, again=again)
        names = {traversal.name for traversal in self.traversals()}
        with self._writing() as connection:
            dialect_of(connection).align_row_ids(connection)
            number = connection.execute(select(func.coalesce(func.max(models.Traversal.number), 0))).scalar_one() + 1
            values = rows.traversal_values(start, number, start.name or traversal_name(start.recording, names))
            return connection.execute(insert(models.Traversal).returning(models.Traversal.id), values).scalar_one()

    def place_traversal(self, traversal_id: int, T_map_odom: FloatArray) -> None:
        """Replace the registration of a traversal's odometry frame in the map."""
        with self._writing() as connection:
            _update_traversal(connection, traversal_id, T_map_odom=rows.to_json(T_map_odom.tolist()))

    def commit(self, traversal_id: int, delta: MapDelta, checkpoint: Checkpoint | None = None) -> None:
        """Write a batch of keyframes with everything that it changed, and the checkpoint, in one transaction."""
        with self._writing() as connection:
            dialect_of(connection).align_row_ids(connection)
            write_delta(connection, traversal_id, delta)
            if checkpoint is not None:
                write_checkpoint(connection, traversal_id, checkpoint)

    def checkpoint(self, traversal_id: int) -> Checkpoint | None:
        """The last checkpoint of an unfinished traversal; `None` if there is none yet."""
        table = models.Checkpoint
        found = self._rows(select(table.part, table.stamp_ns, table.content).where(table.traversal_id == traversal_id))
        return Checkpoint(found[0].stamp_ns, {row.part: row.content for row in found}) if found else None

    def finish_traversal(
        self,
        traversal_id: int,
        timings: Mapping[str, float] | None = None,
        warnings: Sequence[str] = (),
        *,
        end_ns: int | None = None,
        learnt: Mapping[str, object] | None = None,
    ) -> None:
        """Mark the traversal as complete; its immutable rows get their checksums.

        `timings` is seconds per stage; `warnings` are those of the recording, the odometry and the build; `end_ns`
        replaces the end of the span; `learnt` is added to its configuration: what the build found out of its detector.
        """
        with self._writing() as connection:
            measure_moves(connection, traversal_id)
            drop_before_images(connection, traversal_id)
            connection.execute(delete(models.Checkpoint).where(models.Checkpoint.traversal_id == traversal_id))
            changes: dict[str, Any] = {
                "status": "complete",
                "timings": rows.to_json(dict(timings or {})),
                "warnings": rows.to_json(list(warnings)),
            }
            if end_ns is not None:
                changes["end_ns"] = int(end_ns)
            if learnt:
                configured = select(models.Traversal.config).where(models.Traversal.id == traversal_id)
                config = parsed_object(connection.execute(configured).scalar_one(), "the configuration of a traversal")
                changes["config"] = rows.to_json({**config, **learnt})
            _update_traversal(connection, traversal_id, **changes)
            store_sums(connection, (traversal_id,))
        self._database.release_free_pages()  # checkpoints are large

    def import_map(self, other: MapStore, imported: MapImport) -> None:
        """Import another map's traversals in one transaction; the other map is only read."""
        with self._writing() as target, other._reading() as source:
            import_map(target, source, imported)

    def discard_traversal(self, traversal_id: int) -> None:
        """Roll an unfinished traversal back: the map is as it was before.

        Raises `MemoryStoreError` for a complete one.
        """
        with self._writing() as connection:
            status = connection.execute(
                select(models.Traversal.status).where(models.Traversal.id == traversal_id)
            ).scalar_one_or_none()
            if status not in {None, "building"}:
                what = f"traversal {traversal_id} is {status} and stays"
                raise MemoryStoreError(what, where=self.where, cure="only a stopped build is taken back")
            roll_back(connection, traversal_id)
        self._database.release_free_pages()

    def discard_if_created(self) -> bool:
        """Remove the database if this store created it and it has no complete traversal; returns whether it did."""
        if not self._created or any(traversal.status == "complete" for traversal in self.traversals()):
            return False
        self.check_place()
        self._created = False
        self._remove_files()
        return True

    def _remove_files(self) -> None:
        if self._engine is not None:
            self._engine.dispose()
        self._engine = None
        if self._lock is not None:
            self._lock.leave_file()
        self._database.remove()

    def check_place(self) -> None:
        """Raise `MemoryStoreError` if the map was removed, moved or replaced since it was opened for writing."""
        if self._lock is not None:
            self._lock.check_place()

    def remove(self, is_known: Callable[[StoredTraversal], object]) -> None:
        """Remove the map and its files, if it holds no other traversals than those known.

        Raises `MemoryStoreError` otherwise.
        """
        others = [traversal.name for traversal in self.traversals() if not is_known(traversal)]
        if others or self._lock is None:
            raise MemoryStoreError(
                f"this map holds more than would be built anew: {', '.join(others[:3])}",
                where=self.where,
                cure="name another folder, or move the map away",
            )
        if self._engine is not None:
            self.check_place()
            self._remove_files()

    # What mapping continues from

    def traversals(self) -> tuple[StoredTraversal, ...]:
        """All traversals in the order in which they were built."""
        return tuple(map(rows.stored_traversal, self._rows(select_traversals())))

    def load_instances(self, *, merged: bool = False) -> tuple[InstanceRecord, ...]:
        """All instances in the order of their numbers; `merged`: also those that were merged into others."""
        statement = select(models.Instance.__table__).order_by(models.Instance.number)
        if not merged:
            statement = statement.where(models.Instance.merged_into.is_(None))
        return tuple(map(rows.instance_record, self._rows(statement)))

    def instance_ids(self) -> dict[int, str]:
        """The text id of every instance by its number."""
        return {row.number: row.id for row in self._rows(select(models.Instance.number, models.Instance.id))}

    def next_object_number(self) -> int:
        """The number after the largest of all stored instances."""
        largest = self._rows(select(func.max(models.Instance.number).label("number")))
        return (largest[0].number or 0) + 1 if largest else 1

    def load_states(self, numbers: Collection[int] | None = None) -> tuple[StateRecord, ...]:
        """The states of all (or the given) instances, ordered by instance and index."""
        statement = select(models.State.__table__).order_by(models.State.instance_number, models.State.state_index)
        if numbers is not None:
            statement = statement.where(models.State.instance_number.in_(numbers))
        return tuple(map(rows.state_record, self._rows(statement)))

    def load_open_states(self) -> tuple[StateRecord, ...]:
        """The newest state of every instance that is not merged into another, where it has not ended."""
        later = models.State.__table__.alias("later")
        statement = (
            select(models.State.__table__)
            .join(models.Instance, models.Instance.number == models.State.instance_number)
            .where(
                models.Instance.merged_into.is_(None),
                models.State.gone_ns.is_(None),
                ~select(later.c.id)
                .where(
                    later.c.instance_number == models.State.instance_number,
                    later.c.state_index > models.State.state_index,
                )
                .exists(),
            )
            .order_by(models.State.instance_number)
        )
        return tuple(map(rows.state_record, self._rows(statement)))

    def load_spatial_edges(self, *, open_only: bool = True) -> tuple[SpatialEdge, ...]:
        """Spatial edges: the open ones, or all of them."""
        statement = select(models.SpatialEdge.__table__).order_by(models.SpatialEdge.id)
        if open_only:
            statement = statement.where(models.SpatialEdge.until_ns.is_(None))
        return tuple(map(rows.spatial_edge, self._rows(statement)))

    def load_visits(self) -> tuple[tuple[int, Visit], ...]:
        """All visits, each with its traversal's id."""
        order = (models.Visit.traversal_id, models.Visit.instance_number)
        found = self._rows(select(models.Visit.__table__).order_by(*order))
        return tuple((row.traversal_id, rows.visit(row)) for row in found)

    def keyframe_depths(
        self, traversal_ids: Collection[int] | None = None, *, until_ns: int | None = None
    ) -> Iterator[KeyframeRecord]:
        """The keyframes of all (or the given) traversals until `until_ns`, in the order of time, without thumbnails.

        They are read while they are iterated over.
        """
        if self._engine is None:
            return
        columns = [column for column in models.Keyframe.__table__.columns if column.name != "thumbnail_jpeg"]
        statement = select(*columns).order_by(models.Keyframe.stamp_ns, models.Keyframe.id)
        if traversal_ids is not None:
            statement = statement.where(models.Keyframe.traversal_id.in_(traversal_ids))
        if until_ns is not None:
            statement = statement.where(models.Keyframe.stamp_ns <= until_ns)
        with self._reading() as connection:
            for row in connection.execute(statement.execution_options(yield_per=50)):
                yield rows.keyframe_record(row)

    # Queries

    @contextmanager
    def reader(self) -> Iterator[MapReader]:
        """A reader of one snapshot: commits of a running build are not visible to it."""
        with self._reading() as connection:
            yield MapReader(connection, self._database)

    # Size

    def prune(self, policy: PrunePolicy, progress: Progress | None = None, *, dry_run: bool = False) -> PruneCounts:
        """Delete old crops, observations and thumbnails, as described in `pruning`; with `dry_run` only count them.

        If the process is killed, the map is consistent and pruning can be repeated. Raises `MemoryStoreError` while a
        build is unfinished.
        """
        if (unfinished := self.unfinished()) is not None:
            raise MemoryStoreError(
                f"the build of {unfinished.name!r} has not come to its end",
                where=self.where,
                cure="let it go on (`supermap build --resume`), or take it out by building another recording",
            )
        session = self._reading if dry_run else self._writing
        if not dry_run:
            with self._writing() as connection:
                declare_limits(connection, policy)
        total = len(self._rows(select(models.Instance.number).where(models.Instance.merged_into.is_(None))))
        counts, after, done = PruneCounts(), None, 0
        while True:
            with session() as connection:
                after, part = prune_observations(connection, self._database, policy, after, dry_run=dry_run)
            if after is None:
                break
            counts.add(part)
            done = min(done + BATCH, total)
            if progress is not None:
                progress(done, total)
        for traversal in self.traversals() if policy.thumbnails_ns is not None else ():
            with session() as connection:
                counts.add(prune_thumbnails(connection, traversal, policy.thumbnails_ns or 0, dry_run=dry_run))
        return counts

    def vacuum(self) -> None:
        """Release the space of deleted rows, as far as the database can without blocking readers.

        Raises `MemoryStoreError` if there is not enough free space to do so.
        """
        if self._engine is None or self._lock is None:
            raise MemoryStoreError("the map database is not open for writing", where=self.where)
        with self._translated():
            self._database.vacuum(self._engine)

    def repair(self) -> tuple[str, ...]:
        """Make what follows from other rows anew, in one transaction; returns in words what was done."""
        with self._writing() as connection:
            return repair(connection)

    # Sessions

    @contextmanager
    def _reading(self) -> Iterator[Connection]:
        if self._engine is None:
            raise MemoryStoreError("there is no map database", where=self.where, cure="run `supermap build`")
        with self._translated(), self._engine.connect() as connection:
            transaction = connection.begin()
            try:
                yield connection
            finally:
                with suppress(DatabaseError):  # a damaged file may refuse even that
                    transaction.rollback()

    @contextmanager
    def _writing(self) -> Iterator[Connection]:
        if self._engine is None or self._lock is None:
            raise MemoryStoreError("the map database is not open for writing", where=self.where)
        with (
            self._translated(),
            self._engine.connect().execution_options(writes=True) as connection,
            connection.begin(),
        ):
            self._lock.check(connection)
            yield connection
            self._lock.check_place()

    @contextmanager
    def _translated(self) -> Iterator[None]:
        """Raise `MemoryStoreError` for what a user can mend (full disk, damaged file); a broken constraint is a bug."""
        try:
            yield
        except IntegrityError:
            raise
        except UnicodeDecodeError as error:  # SQLite's own message quotes the damaged file
            raise damaged(f"what it holds is no text: {error.reason}", self.where) from error
        except DatabaseError as error:
            raise self._database.failure(error) from error

    def _rows(self, statement: Select[*tuple[Any, ...]]) -> list[Row[*tuple[Any, ...]]]:
        """All rows; none if there is no map yet."""
        if self._engine is None:
            return []
        with self._reading() as connection:
            return list(connection.execute(statement))

    def _create_if_missing(self) -> None:
        if self._engine is not None or self._lock is None:
            return
        from supermap_schema.upgrading import upgrade  # noqa: PLC0415 - Alembic is needed only here

        self._created = True
        self._engine = self._database.writer_engine()
        with self._writing() as connection:
            self._database.prepare(connection)
            upgrade(connection)


def _update_traversal(connection: Connection, traversal_id: int, **values: Any) -> None:
    changed = connection.execute(
        update(models.Traversal).where(models.Traversal.id == traversal_id).values(**values)
    ).rowcount
    if changed != 1:
        raise ValueError(f"there is no traversal {traversal_id}")
