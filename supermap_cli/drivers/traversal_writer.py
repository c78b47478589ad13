"""Stores what a session gives, for drivers that push what no recording holds: a robot, a simulator, a notebook."""

from __future__ import annotations

from collections.abc import Iterable
from types import TracebackType
from typing import Self

from supermap_cli.config import BuildConfig
from supermap_cli.drivers.build_summary import session_summary
from supermap_cli.drivers.prior_map import load_prior_map
from supermap_cli.errors import MemoryStoreError
from supermap_cli.memory.store import MapStore
from supermap_cli.memory.values import TraversalStart
from supermap_cli.observing import Observers
from supermap_cli.parameters import stored_config
from supermap_cli.plugin_manager import Plugins, load_plugins, make_observers
from supermap_cli.protocols import Source
from supermap_cli.relations.map_relations import CONFIG_ENTRY, described
from supermap_cli.session import MappingSession
from supermap_cli.stages.session_state import SessionBackends, begin
from supermap_cli.types.memory import MapDelta, coalesce
from supermap_cli.types.session import SessionContext
from supermap_cli.version import __version__


class TraversalWriter:
    """One traversal: `open_session`, push, `write` what `step` gives, `finish`.

    Used in a `with` statement, it takes out what it wrote where the traversal was not finished. `warnings` says what
    went wrong with observers, one line each.
    """

    def __init__(self, store: MapStore, name: str, config: BuildConfig | None = None) -> None:
        self.warnings: list[str] = []
        self._store = store
        self._name = name
        self._config = config or BuildConfig()
        self._session: MappingSession | None = None
        self._source: Source | None = None
        self._waiting: list[MapDelta] = []
        self._traversal_id: int | None = None
        self._newest_ns = 0
        self._observers = Observers()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        try:
            if self._traversal_id is not None:
                self._store.discard_traversal(self._traversal_id)
            self._store.discard_if_created()
        finally:
            self._end_observers(complete=False)

    def open_session(
        self,
        backends: SessionBackends,
        *,
        align: str = "auto",
        plugins: Plugins | None = None,
        observers: Observers | None = None,
        source: Source | None = None,
    ) -> MappingSession:
        """A session that starts from what is in the map. It is followed by `observers`, or else by those of `plugins`
        (of all that are installed); they are told of the end by `finish`, or at the end of the `with` statement.

        The warnings of the `source` that will be pushed, if there is one, are stored with the traversal. Raises
        `MemoryStoreError` where a stopped build is in the way.
        """
        self._source = source
        self._observers = observers or self._observers
        self._check_none_unfinished()
        state = begin(self._config, load_prior_map(self._store))
        if observers is None:
            self._observers = self._made_observers(plugins)
        self._observers.started(self._context())
        self._session = MappingSession(self._config, backends, state, align=align, observers=self._observers)
        return self._session

    def write(self, deltas: Iterable[MapDelta]) -> None:
        """Store what keyframes changed, in transactions of `keyframes.batch` of them.

        Raises `MemoryStoreError` where the first one is older than what is in the map.
        """
        for delta in deltas:
            self._waiting.append(delta)
            self._newest_ns = max((self._newest_ns, *(keyframe.stamp_ns for keyframe in delta.keyframes)))
            if len(self._waiting) >= self._config.keyframes.batch:
                self._commit()

    def finish(self) -> None:
        """The traversal is in the map for good. Raises `MemoryStoreError` where no keyframe was mapped."""
        self._commit()
        if self._traversal_id is None:
            raise MemoryStoreError("no keyframe was mapped", where=self._store.where, cure="push frames with poses")
        learnt = {} if self._session is None else {"detector_recall": self._session.engine.recall.by_class()}
        self._store.finish_traversal(
            self._traversal_id, warnings=self._stored_warnings(), end_ns=self._newest_ns, learnt=learnt
        )
        self._traversal_id = None
        self._end_observers(complete=True)

    def _commit(self) -> None:
        if self._waiting:
            batch = coalesce(self._waiting)
            if self._traversal_id is None:
                self._traversal_id = self._begin(batch)
            self._store.commit(self._traversal_id, batch)
            self._observers.committed(batch)
            self._waiting = []

    def _begin(self, first: MapDelta) -> int:
        if self._session is None or self._session.placement is None:
            raise ValueError("deltas come from this writer's session")
        start_ns = first.keyframes[0].stamp_ns
        known_ns = max((traversal.mapped_ns or 0 for traversal in self._store.traversals()), default=0)
        if start_ns <= known_ns:
            raise MemoryStoreError(
                f"the first frame is {(known_ns - start_ns) / 1e9:.1f} s older than what is in the map",
                where=self._store.where,
                cure="set the clock, or push later stamps",
            )
        return self._store.begin_traversal(
            TraversalStart(
                recording=self._name,
                fingerprint=f"pushed {self._name} {start_ns}",
                start_ns=start_ns,
                end_ns=self._newest_ns,
                T_map_odom=self._session.placement.T_map_odom,
                config={
                    **stored_config(self._config),
                    "detector": self._session.backends.detector,
                    CONFIG_ENTRY: described(self._session.backends.predicates),
                    "placed": self._session.placement.method,
                },
                versions={"supermap": __version__},
                name=self._name,
            )
        )

    def _check_none_unfinished(self) -> None:
        unfinished = self._store.unfinished()
        if unfinished is not None:
            raise MemoryStoreError(
                f"the build of {unfinished.name!r} has not come to its end",
                where=self._store.where,
                cure="let it go on (`supermap build --resume`), or take out what it wrote (`roll_back_unfinished`)",
            )

    def _context(self) -> SessionContext:
        cameras = () if self._source is None else tuple(self._source.cameras)
        return SessionContext(self._name, self._store.where, self._name, cameras, {})

    def _made_observers(self, plugins: Plugins | None) -> Observers:
        made, warnings = make_observers(load_plugins() if plugins is None else plugins, self._context())
        self.warnings += warnings
        return Observers(made)

    def _stored_warnings(self) -> tuple[str, ...]:
        """What the source and the session warn of, one line each."""
        of_source = () if self._source is None else self._source.warnings
        return (*of_source, *(() if self._session is None else self._session.warnings))

    def _end_observers(self, *, complete: bool) -> None:
        """Once: the observers are told of the end, and get to it within `observing.CLOSE_TIMEOUT_S`."""
        observers, self._observers = self._observers, Observers()
        if self._session is not None:
            warnings = (*self._stored_warnings(), *self.warnings)
            observers.ended(session_summary(self._session, warnings, complete=complete))
        self.warnings += observers.close()
