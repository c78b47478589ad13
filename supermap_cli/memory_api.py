"""The memory for Python programs: the answers of the command line as typed values.

    import supermap_cli as supermap

    with supermap.open("office.db") as memory:
        print(memory.query("chair near the tv").message)

Every call reads the newest state of the map: a build may be writing at the same time. Errors are `SupermapError`s.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from supermap_cli.errors import QueryError
from supermap_cli.language.lexicon import load_lexicon
from supermap_cli.language.questions import Changes, MostOf, Question, Related, Usable
from supermap_cli.language.times import AtClock, InTraversal, Since
from supermap_cli.language.typed_json import named_in, question_from_json
from supermap_cli.memory.opening import open_store
from supermap_cli.memory.reading import MapReader
from supermap_cli.query.answers import Answer, answer, answer_question
from supermap_cli.query.clock import Clock, clock_of
from supermap_cli.query.details import ObjectDetails, details, details_at
from supermap_cli.query.last_looks import LastLook, UnseenPlaces, last_looks, places_not_seen_since
from supermap_cli.query.overview import Overview, overview, overview_at
from supermap_cli.query.time_points import parse_time_point
from supermap_cli.query.views import (
    DEFAULT_LIMIT,
    InstanceView,
    RelationView,
    TraversalView,
    to_document,
    traversal_view,
)
from supermap_cli.relations.map_relations import relations_of_configs

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd

    from supermap_cli.navigation.grid import OccupancyGrid
    from supermap_cli.navigation.route import DrivingRobot, PlannedRoute, PoseView
    from supermap_cli.query.answering.pictures import Picture
    from supermap_cli.query.diff import Diff
    from supermap_cli.query.object_history import ObjectHistory

EVERYTHING = 1_000_000_000
"""A limit above the number of objects in any map."""


def open_memory(db: str) -> Memory:
    """Open a map for reading: a SQLite file or a database URL, as `--db` takes it.

    Raises `MemoryStoreError`: not found, no map database, or of another version.
    """
    return Memory(db)


class Memory:
    """A map that was opened for reading; a context manager. Its methods may be called from several threads."""

    def __init__(self, db: str) -> None:
        self._store = open_store(db, read_only=True)
        self._lock = threading.RLock()
        self._grids: dict[tuple[object, ...], OccupancyGrid] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the database."""
        self._store.close()

    @contextmanager
    def reader(self) -> Iterator[MapReader]:
        """A snapshot of the map, for what has no method here; it does not see what is written meanwhile."""
        with self._lock, self._store.reader() as reader:
            yield reader

    # Questions

    def query(
        self,
        text: str,
        at: str | None = None,
        limit: int = DEFAULT_LIMIT,
        *,
        language: str | None = None,
        explain: bool = False,
        loose: bool = False,
    ) -> Answer:
        """Answer a question, as `supermap query`. Raises `QueryError` for one that is not understood."""
        with self.reader() as reader:
            return answer(text, reader, at, limit, language=language, explain=explain, loose=loose)

    def ask_typed(
        self, question: Question | Mapping[str, Any], at: str | None = None, limit: int = DEFAULT_LIMIT
    ) -> Answer:
        """Answer a typed question: a value of `supermap_cli.language.questions`, or its JSON
        (`supermap_cli.language.typed_json`). Raises `QueryError` for what is none.
        """
        typed = question if isinstance(question, Question) else question_from_json(question)
        with self.reader() as reader:
            _check_names(typed, reader)
            return answer_question(typed, reader, at, limit)

    # Things

    def objects(self, at: str | None = None, limit: int | None = None) -> tuple[InstanceView, ...]:
        """What stands now, or stood at a time, as `supermap show` lists it."""
        return self.overview(at, limit).instances

    def overview(self, at: str | None = None, limit: int | None = None) -> Overview:
        """What stands now or stood at a time, what is unknown, counts, and the traversals, as `supermap show`."""
        most = EVERYTHING if limit is None else limit
        with self.reader() as reader:
            if at is None:
                return overview(reader, most)
            clock = clock_of(reader)
            return overview_at(reader, parse_time_point(at, reader, clock), clock, most)

    def show(self, text_id: str, at: str | None = None) -> ObjectDetails:
        """All that is known of one thing, as `supermap show ID`. Raises `QueryError` for an unknown id."""
        with self.reader() as reader:
            if at is None:
                return details(reader, text_id)
            clock = clock_of(reader)
            return details_at(reader, text_id, parse_time_point(at, reader, clock), clock)

    def history(self, text_id: str, at: str | None = None) -> ObjectHistory:
        """The life of one thing, as `supermap history ID`. Raises `QueryError` for an unknown id."""
        from supermap_cli.query.object_history import object_history  # noqa: PLC0415 - few programs ask for one

        with self.reader() as reader:
            clock = clock_of(reader)
            return object_history(reader, text_id, None if at is None else parse_time_point(at, reader, clock), clock)

    def relations_around(self, text_id: str, at: str | None = None) -> tuple[RelationView, ...]:
        """The relations of one thing that hold now or at a time."""
        return self.show(text_id, at).relations

    # Time

    def traversals(self) -> tuple[TraversalView, ...]:
        """All traversals in the order in which they were built."""
        with self.reader() as reader:
            return tuple(map(traversal_view, reader.traversals))

    def diff(self, before: str | None = None, after: str | None = None) -> Diff:
        """What changed between two traversals or times, as `supermap diff`."""
        from supermap_cli.query.diff import diff  # noqa: PLC0415 - few programs ask for one

        with self.reader() as reader:
            return diff(reader, before, after)

    def changes_since(self, since: str, limit: int = DEFAULT_LIMIT) -> Answer:
        """What changed since a time or the end of a traversal: the answer to "what changed since ..."."""
        with self.reader() as reader:
            point = parse_time_point(since, reader, clock_of(reader))
            moment = AtClock(since) if point.traversal is None else InTraversal(point.traversal.name)
            asked = Question(f"what changed since {since}", Changes(), Since(moment))
            return answer_question(asked, reader, limit=limit)

    def last_looks(self, *ids: str) -> tuple[LastLook, ...]:
        """When the places of some things were last looked at."""
        with self.reader() as reader:
            return last_looks(reader, ids)

    def places_not_seen_since(self, since: str, limit: int = DEFAULT_LIMIT) -> UnseenPlaces:
        """The places of things that nobody has looked at since a time or the end of a traversal."""
        with self.reader() as reader:
            return places_not_seen_since(reader, parse_time_point(since, reader, clock_of(reader)), limit)

    def clock(self) -> Clock:
        """Converts sensor time to text."""
        with self.reader() as reader:
            return clock_of(reader)

    # Places to drive to

    def navigate(
        self,
        instruction: str,
        robot: DrivingRobot | None = None,
        start: tuple[float, float, float] | None = None,
        *,
        language: str | None = None,
    ) -> PlannedRoute:
        """Poses for an instruction, as `supermap navigate`; `start` is x, y in metres and yaw in radians."""
        from supermap_cli.navigation.route import DrivingRobot, plan_route  # noqa: PLC0415 - loads scipy

        robot = robot or DrivingRobot()
        with self.reader() as reader:
            grid = self._grid(reader, robot.height_m)
            return plan_route(reader, instruction, robot, start, language=language, grid=grid)

    def goal_near(
        self,
        x: float,
        y: float,
        robot: DrivingRobot | None = None,
        start: tuple[float, float, float] | None = None,
    ) -> PoseView:
        """The free pose nearest to a point of the map that a robot can reach, turned to the point.

        Raises `QueryError` where no free floor is near the start.
        """
        from supermap_cli.navigation.route import DrivingRobot, pose_near  # noqa: PLC0415 - loads scipy

        if not (math.isfinite(x) and math.isfinite(y)):
            raise QueryError("a point needs finite x and y", cure="give metres in the frame map")
        robot = robot or DrivingRobot()
        with self.reader() as reader:
            return pose_near(reader, (x, y), robot, start, grid=self._grid(reader, robot.height_m))

    def grid(self, robot_height_m: float | None = None) -> OccupancyGrid:
        """The floor from above: free, occupied, never seen. Raises `QueryError` for a map without depth images."""
        with self.reader() as reader:
            return self._grid(reader, robot_height_m)

    def _grid(self, reader: MapReader, height_m: float | None) -> OccupancyGrid:
        from supermap_cli.navigation.observed_space import occupancy_grid  # noqa: PLC0415 - loads scipy

        state = tuple((each.id, each.keyframes, each.mapped_ns, each.status) for each in reader.traversals)
        key = (height_m, state)
        if key not in self._grids:
            self._grids = {kept: grid for kept, grid in self._grids.items() if kept[1] == state}
            self._grids[key] = occupancy_grid(reader, height_m)
        return self._grids[key]

    # Pictures

    def picture(self, text_id: str) -> Picture:
        """The best stored picture of a thing (JPEG). Raises `QueryError` where there is none."""
        from supermap_cli.language.questions import Find, Identified, Things  # noqa: PLC0415 - as below
        from supermap_cli.language.times import Last  # noqa: PLC0415
        from supermap_cli.query.answering.pictures import picture_of  # noqa: PLC0415 - few programs ask for one

        with self.reader() as reader:
            asked = Question(text_id, Find(Things(Identified(details(reader, text_id).id))), Last())
            return picture_of(answer_question(asked, reader, limit=1), reader)

    # Other libraries

    def graph(self, at: str | None = None) -> nx.MultiDiGraph:
        """The scene graph: things by id as nodes (label, position, size, presence, times), relations that hold now or
        at a time as edges (key: the relation's name). Needs the extra `graph`.
        """
        library = _imported("networkx", "graph")
        made = library.MultiDiGraph()
        for row in self._rows("instances", at):
            if row["presence"] != "doubted":
                made.add_node(row.pop("id"), **row)
        for row in self._rows("spatial_edges", at):
            subject, relation, other = (row.pop(name) for name in ("subject", "relation", "object"))
            holds = at is not None or row["until_ns"] is None  # as of a time, only those that held then are read
            if holds and subject in made and other in made:
                made.add_edge(subject, other, key=relation, relation=relation, **row)
        return made

    def to_pandas(self, table: str = "instances", at: str | None = None) -> pd.DataFrame:
        """A table of the map: `traversals`, `keyframes`, `instances`, `states`, `observations`, `visits`,
        `spatial_edges` or `temporal_edges`, with the columns of `supermap export --format csv`. Needs the extra
        `pandas`.
        """
        pandas = _imported("pandas", "pandas")
        rows = list(self._rows(table, at))
        return pandas.DataFrame(rows, columns=_columns_of(table))

    def _rows(self, table: str, at: str | None) -> Iterator[dict[str, Any]]:
        """The rows of an exported table, each by its columns."""
        from supermap_cli.exporting.selection import (  # noqa: PLC0415 - few programs ask for one
            ALL_PRESENCES,
            POSSIBLY_PRESENT,
            ExportSource,
            select_part,
        )
        from supermap_cli.exporting.tables import TABLES  # noqa: PLC0415

        columns = _columns_of(table)
        wanted = next(each for each in TABLES if each.name == table)
        with self.reader() as reader:
            selection = select_part(reader, presences=POSSIBLY_PRESENT if at else ALL_PRESENCES, at=at)
            for row in wanted.written_rows(ExportSource(reader, selection, None)):
                yield dict(zip(columns, row, strict=True))


def _check_names(question: Question, reader: MapReader) -> None:
    """Raises `QueryError` for relations and uses that neither the map nor the lexicon knows."""
    registry = relations_of_configs(traversal.config for traversal in reader.traversals)[0]
    relations = frozenset(relation.name for relation in registry)
    asked = named_in(question.body, Related, "relation") | named_in(question.body, MostOf, "relation")
    for kind, names, known in (
        ("relation", asked, relations),
        ("use", named_in(question.body, Usable, "use"), load_lexicon("en").uses.keys()),
    ):
        if unknown := sorted(names - known):
            raise QueryError(f"there is no {kind} {unknown[0]!r}", cure=f"there are {', '.join(sorted(known))}")


def _columns_of(table: str) -> list[str]:
    from supermap_cli.exporting.tables import TABLES  # noqa: PLC0415 - few programs ask for one

    known = {each.name: [column.name for column in each.written_columns] for each in TABLES}
    if table not in known:
        raise QueryError(f"there is no table {table!r}", cure=f"there are {', '.join(known)}")
    return known[table]


def _imported(name: str, extra: str) -> Any:
    from importlib import import_module  # noqa: PLC0415 - beside its only use

    try:
        return import_module(name)
    except ImportError as error:
        cure = f"pip install 'supermap-cli[{extra}]'"
        raise QueryError(f"this needs {name}, which is not installed", cure=cure) from error


__all__ = ["Memory", "open_memory", "to_document"]
