"""Filling roles with topics: by what the user named, else by rank, with the reason why the runner-up lost."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from supermap_cli.errors import RecordingError
from supermap_cli.recordings.roles import ROLES, role_name
from supermap_cli.recordings.survey import Topic
from supermap_cli.recordings.topic_plan import TopicChoice
from supermap_cli.types.sensing import MAIN_CAMERA


class RoleFilling:
    """Roles that are filled one after the other: by what the user named, else by the best candidate."""

    def __init__(
        self, topics: Sequence[Topic], named: Mapping[str, str], where: str, camera_id: str = MAIN_CAMERA
    ) -> None:
        self._topics = topics
        self._named = named
        self._where = where
        self._camera_id = camera_id
        self.chosen: dict[str, TopicChoice] = {}

    def topic(self, role: str) -> Topic | None:
        """What serves a role so far."""
        choice = self.chosen.get(role)
        return choice.topic if choice else None

    def is_named(self, role: str) -> bool:
        """Whether the user named the topic of a role."""
        return role in self._named

    def choose(
        self,
        role: str,
        candidates: Sequence[Topic],
        rank: Callable[[Topic], tuple[float, ...]],
        lost: Sequence[str] = (),
    ) -> None:
        """Fill a role with the topic named for it, else with the candidate of the highest rank, if there is one.

        `lost` says of each element of the rank what is wrong with a topic that has less of it.
        """
        if role in self._named:
            self.chosen[role] = TopicChoice(role, self._named_topic(role), "named by the user", named=True)
            return
        usable = sorted(candidates, key=lambda topic: topic.name)
        if not usable:
            self.chosen.pop(role, None)
            return
        best = max(usable, key=rank)
        others = [topic for topic in usable if topic is not best]
        reason = f"rather than {', '.join(topic.name for topic in others)}" if others else "the only one of its kind"
        if others and (why := _why_lost(rank(best), max(others, key=rank), rank, lost)):
            reason = f"{reason}: {why}"
        self.chosen[role] = TopicChoice(role, best, reason)

    def _named_topic(self, role: str) -> Topic:
        name, key = self._named[role], role_name(role, self._camera_id)
        fitting = [topic for topic in self._topics if topic.kind in ROLES[role]]
        for topic in fitting:
            if topic.name == name:
                return topic
        listed = ", ".join(topic.name for topic in fitting) or "none"
        there = any(topic.name == name for topic in self._topics)
        what = f"topic {name} cannot serve as {key}" if there else f"no messages on topic {name}, named for {key}"
        raise RecordingError(what, where=self._where, cure=f"topics that could be: {listed}")


def _why_lost(
    best: tuple[float, ...], runner_up: Topic, rank: Callable[[Topic], tuple[float, ...]], lost: Sequence[str]
) -> str:
    """What is wrong with the runner-up: the first element of its rank that is less than the best one's."""
    words = (word for of_best, own, word in zip(best, rank(runner_up), lost, strict=False) if of_best != own)
    word = next(words, "")
    return f"{runner_up.name} {word}" if word else ""
