"""Classification of the change of one instance between two time points, from its states, visits and temporal edges
alone.

A change is assigned to its later bound: an object that is known to have gone or come by then is counted there. So each
change lies in exactly one of two adjoining intervals, and diffs add up. Only a contradiction makes a disappearance, and
only a place seen empty makes an appearance; an object that was not in view is neither.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, get_args

from supermap_cli.geometry.boxes import displacement_m
from supermap_cli.memory.values import StoredInstance, StoredTraversal, StoredVisit
from supermap_cli.query.presence_at import state_held_at
from supermap_cli.query.time_points import TimePoint
from supermap_cli.types.existence import probability_of
from supermap_cli.types.memory import StateRecord, TemporalEdge

ChangeKind = Literal[
    "appeared",
    "disappeared",
    "moved",
    "relabelled",
    "unchanged",
    "not observed again",
    "first observed",
    "not looked at",
    "at neither",
    "doubted",
]
CHANGE_KINDS: tuple[ChangeKind, ...] = get_args(ChangeKind)
"""In the order of reports: changes, unchanged, undecidable, what stood at neither time, what may never have been."""

MIN_MOVE_M = 0.1
"""Displacement (m) from which two states count as different places."""


@dataclass(frozen=True)
class ChangeClassification:
    """The change of an instance, without evidence.

    `before` and `after` are the states at the two time points; `not_before_ns` and `not_after_ns` bound the change.
    """

    kind: ChangeKind
    reason: str
    confidence: float
    not_before_ns: int | None = None
    not_after_ns: int | None = None
    before: StateRecord | None = None
    after: StateRecord | None = None


@dataclass(frozen=True)
class ComparedTimes:
    """The two time points of a comparison, the earlier first, and the ids of the traversals whose visits count for
    each: a traversal itself; for a plain time all that had begun by then, respectively all that ran between the two.
    """

    before: TimePoint
    after: TimePoint
    traversal_ids_before: frozenset[int]
    traversal_ids_after: frozenset[int]

    @property
    def since_ns(self) -> int:
        """From when on an observation counts for the later time point."""
        return max(self.before.at_ns + 1, self.after.since_ns if self.after.traversal is not None else 0)


def compared_times(before: TimePoint, after: TimePoint, traversals: Sequence[StoredTraversal]) -> ComparedTimes:
    """Two time points with the traversals that observed for each."""
    begun_before = {traversal.id for traversal in traversals if traversal.start_ns <= before.at_ns}
    in_between = {
        traversal.id
        for traversal in traversals
        if traversal.start_ns <= after.at_ns and traversal.end_ns > before.at_ns
    }
    return ComparedTimes(
        before,
        after,
        frozenset(begun_before if before.traversal is None else {before.traversal.id}),
        frozenset(in_between if after.traversal is None else {after.traversal.id}),
    )


@dataclass(frozen=True)
class StateComparison:
    """One instance at two time points, with its temporal edges and the text ids of other instances."""

    instance: StoredInstance
    times: ComparedTimes
    edges: Collection[TemporalEdge] = ()
    text_ids: Mapping[int, str] = field(default_factory=dict)

    @property
    def before(self) -> TimePoint:
        """The earlier time point."""
        return self.times.before

    @property
    def after(self) -> TimePoint:
        """The later time point."""
        return self.times.after

    def account(self) -> ChangeClassification | None:
        """What to say of the instance; `None` only if it neither stood at one of the time points nor was observed for
        them: it is no thing of either.
        """
        if self.instance.presence == "doubted":
            return self._doubted()
        return self.classify() or self._at_neither() or self._not_looked_at()

    def classify(self) -> ChangeClassification | None:
        """The change; `None` if the instance is present at neither time point, or observed for neither."""
        old = state_held_at(self.instance.states, self.before.at_ns)
        new = state_held_at(self.instance.states, self.after.at_ns)
        if old is not None and new is not None:
            return self._same_state(old) if old.index == new.index else self._other_state(old, new)
        if new is not None:
            return self._arrived(new)
        return self._disappeared(old) if old is not None else self._absent_at_both()

    def transient(self) -> Literal["came and went", "left"] | None:
        """For an instance without a classification: whether it came and went in between, or was seen to leave in the
        earlier of two traversals.
        """
        if any(self.before.at_ns < state.first_seen_ns <= self.after.at_ns for state in self.instance.states):
            return "came and went" if state_held_at(self.instance.states, self.after.at_ns) is None else None
        gone = state_held_at(self.instance.states, self.before.at_ns) is None
        return "left" if gone and self.before.traversal is not None and self._observed_at(self.before) else None

    # -- what is no change

    def _doubted(self) -> ChangeClassification:
        """Believed in no more today, with what the visits to compare say for and against it."""
        old, new = (state_held_at(self.instance.states, end.at_ns) for end in (self.before, self.after))
        probability = probability_of(self.instance.existence_log_odds)
        visits = self._visits(self.times.traversal_ids_before | self.times.traversal_ids_after)
        found, in_view = sum(visit.supported for visit in visits), sum(visit.in_view for visit in visits)
        contradicted = sum(visit.contradicted for visit in visits)
        empty = f"seen empty in {contradicted} of them" if contradicted else "never seen empty"
        reason = (
            f"real with {probability:.0%}; for it: found in {found} of the {in_view} keyframes that had its place in "
            f"view, {empty}; against it: not found in {in_view - found}"
            if in_view
            else f"real with {probability:.0%}; its place was in view in neither"
        )
        return ChangeClassification("doubted", reason, probability, None, None, old, new)

    def _at_neither(self) -> ChangeClassification | None:
        """Observed, but not there at either time point."""
        seen = [end.text for end in (self.before, self.after) if end.traversal is not None and self._observed_at(end)]
        if self.transient() == "came and went":
            reason = f"came and went between {self.before.text} and {self.after.text}"
        elif seen and all(state_held_at(self.instance.states, end.at_ns) is None for end in (self.before, self.after)):
            reason = f"seen by {' and '.join(seen)}, and gone again before its end"
        else:
            return None
        states = self._states_begun_by(self.after.at_ns) or self.instance.states
        return ChangeClassification("at neither", reason, states[-1].confidence if states else 0.0)

    def _not_looked_at(self) -> ChangeClassification | None:
        """It stood at one of the time points as far as the map knows, and neither observed it."""
        old, new = (state_held_at(self.instance.states, end.at_ns) for end in (self.before, self.after))
        state = new or old
        if state is None:
            return None
        visits = self._visits(self.times.traversal_ids_before | self.times.traversal_ids_after)
        in_view = sum(visit.in_view for visit in visits)
        seen = f"in view in {in_view} keyframes, and not found" if in_view else "in view of neither"
        reason = f"known from other visits; {seen}"
        return ChangeClassification("not looked at", reason, state.confidence, None, None, old, new)

    def _visits(self, traversal_ids: Collection[int]) -> list[StoredVisit]:
        return [visit for visit in self.instance.visits if visit.traversal_id in traversal_ids]

    # -- classification

    def _same_state(self, state: StateRecord) -> ChangeClassification | None:
        """In the same state at both time points."""
        observed_before = self.before.traversal is None or self._observed_at(self.before)
        observed_after = self._observed_at(self.after)
        if state.last_seen_ns < self.times.since_ns:
            return self._not_observed_again(state) if observed_before else None
        if not observed_before and not observed_after:
            return None
        gone_later = state.last_seen_ns < self.after.at_ns and state.gone_ns is not None
        if gone_later and self.after.traversal is None:
            return self._not_observed_again(state)
        unobserving = self.after if not observed_after else self.before
        through = f"seen in its place before and after {unobserving.text}, which did not see it"
        reason = "seen in its place in both" if observed_before and observed_after else through
        return ChangeClassification("unchanged", reason, state.confidence, None, None, state, state)

    def _other_state(self, old: StateRecord, new: StateRecord) -> ChangeClassification:
        """In different states at the two time points."""
        edge = self._edge("moved", new)
        distance_m = state_distance_m(old, new)
        if distance_m < MIN_MOVE_M:
            moved = any(state_distance_m(old, state) >= MIN_MOVE_M for state in self._states_between(old, new))
            reason = f"seen in its place in both, {'moved' if moved else 'gone'} in between"
            return ChangeClassification("unchanged", reason, new.confidence, None, None, old, new)
        confidence = min(old.confidence, new.confidence) if edge is None else edge.probability
        stops = len(self._states_between(old, new))
        by_way = f", by way of {stops} other place{'s' if stops > 1 else ''}" if stops else ""
        reason = f"seen {distance_m:.2f} m away{by_way}"
        return ChangeClassification("moved", reason, confidence, old.last_seen_ns, new.first_seen_ns, old, new)

    def _disappeared(self, old: StateRecord | None) -> ChangeClassification:
        """No longer in its last known place."""
        last = self._states_begun_by(self.after.at_ns)[-1]
        edge = self._edge("disappeared", last)
        confidence = last.confidence if edge is None else min(last.confidence, edge.probability)
        moved = "" if old is None or state_distance_m(old, last) < MIN_MOVE_M else "was moved, and "
        first = "" if old is not None else f"first seen after {self.before.text}; "
        reason = f"{first}{moved}its place was seen empty"
        return ChangeClassification("disappeared", reason, confidence, last.last_seen_ns, last.gone_ns, old, None)

    def _arrived(self, new: StateRecord) -> ChangeClassification:
        """In a state at the later time point, and in none at the earlier one."""
        earlier = self._states_begun_by(self.before.at_ns)
        left, first = earlier[-1] if earlier else None, self._states_begun_by(self.after.at_ns)[len(earlier)]
        back = left is not None and state_distance_m(left, first) < MIN_MOVE_M
        moved = self._edge("moved", first)
        if moved is not None and left is not None and state_distance_m(left, new) >= MIN_MOVE_M:
            reason = f"seen {state_distance_m(left, new):.2f} m from where it stood before, which was found empty first"
            return ChangeClassification(
                "moved", reason, moved.probability, left.last_seen_ns, new.first_seen_ns, left, new
            )
        empty_ns = left.gone_ns if left is not None and back else first.empty_before_ns
        if empty_ns is not None:
            edge = self._edge("appeared", first)
            confidence = new.confidence if edge is None else min(new.confidence, edge.probability)
            reason = "had gone from its place, was seen there again" if back else "its place had been seen empty"
            return ChangeClassification("appeared", reason, confidence, empty_ns, first.first_seen_ns, None, new)
        if left is not None and state_distance_m(left, new) >= MIN_MOVE_M:
            reason = f"seen {state_distance_m(left, new):.2f} m from where it stood before, which was found empty first"
            edge = self._edge("moved", first)
            confidence = min(left.confidence, new.confidence) if edge is None else edge.probability
            return ChangeClassification("moved", reason, confidence, left.last_seen_ns, new.first_seen_ns, left, new)
        if left is not None:
            reason = "had gone from its place, stands there again after it was seen elsewhere"
            return ChangeClassification("appeared", reason, new.confidence, left.gone_ns, new.first_seen_ns, None, new)
        return ChangeClassification(
            "first observed", self._first_observed_reason(first), new.confidence, None, None, None, new
        )

    def _absent_at_both(self) -> ChangeClassification | None:
        """In no state at either time point. If it came and went in between, it may have been present before, unless its
        place had been seen empty.
        """
        states_begun = self._states_begun_by(self.after.at_ns)
        if (
            not states_begun
            or states_begun[0].first_seen_ns <= self.before.at_ns
            or states_begun[0].empty_before_ns is not None
        ):
            return None
        return self._disappeared(None)

    def _not_observed_again(self, state: StateRecord) -> ChangeClassification:
        """Neither observed nor contradicted since."""
        visits = self._visits(self.times.traversal_ids_after)
        in_view, contradicted = sum(visit.in_view for visit in visits), sum(visit.contradicted for visit in visits)
        where = f"in {self.after.text}" if self.after.traversal is not None else "in between"
        if state.gone_ns is not None and self.after.traversal is None:
            reason = "was found gone later, after it had been seen last before: nobody can say for this time"
        elif in_view == 0:
            reason = f"its place was never in view {where}"
        elif contradicted == 0:
            reason = f"its place was in view in {in_view} keyframes and never seen empty"
        else:
            reason = (
                f"its place was in view in {in_view} keyframes and looked empty in {contradicted}, too few to be sure"
            )
        return ChangeClassification("not observed again", reason, state.confidence, None, None, state, None)

    def _first_observed_reason(self, new: StateRecord) -> str:
        split = self._edge("split", new)
        if split is not None and split.to_number == self.instance.number:
            other = self.text_ids.get(split.from_number, "another")
            return f"was one with {other} until the two were told apart"
        where = f"in {self.before.text}" if self.before.traversal is not None else "before"
        visits = self._visits(self.times.traversal_ids_before)
        if any(visit.in_view > 0 for visit in visits):
            return f"its place was in view {where}, but never seen empty"
        return f"nobody had seen its place empty {where}"

    # -- evidence

    def _observed_at(self, end: TimePoint) -> bool:
        """Whether it was observed for a time point; for a plain time: between the two."""
        if end.traversal is not None:
            return self.instance.visit(end.traversal.id).supported > 0
        return any(
            state.first_seen_ns <= self.after.at_ns and state.last_seen_ns > self.before.at_ns
            for state in self.instance.states
        )

    def _states_begun_by(self, at_ns: int) -> list[StateRecord]:
        return [state for state in self.instance.states if state.first_seen_ns <= at_ns]

    def _states_between(self, old: StateRecord, new: StateRecord) -> list[StateRecord]:
        return [state for state in self.instance.states if old.index < state.index < new.index]

    def _edge(self, kind: str, state: StateRecord) -> TemporalEdge | None:
        """The temporal edge of a kind that touches a state."""
        touched = (self.instance.number, state.index)
        for edge in self.edges:
            if edge.kind == kind and touched in {(edge.from_number, edge.from_state), (edge.to_number, edge.to_state)}:
                return edge
        return None


def state_distance_m(first: StateRecord, second: StateRecord) -> float:
    """Displacement (m) between the boxes of two states."""
    return displacement_m(first.box, second.box)
