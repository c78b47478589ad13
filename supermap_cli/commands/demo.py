"""`supermap demo`: the whole of it on a simulated place, explained."""

from __future__ import annotations

import re
import shlex
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer

from supermap_cli.errors import SimulationError, TruthError

if TYPE_CHECKING:
    from supermap_cli.evaluation.changes import ChangeScores
    from supermap_cli.evaluation.estimate import EstimatedMap
    from supermap_cli.types.truth import GroundTruth, TrueChange

EXAMPLES = """
Examples:

    supermap demo

    supermap demo --folder /tmp/demo --seed 7
"""
DB, PICTURE = "map.db", "evaluation.png"
SCENARIO = "demo"
REPLACED = ("monday.mcap", "tuesday.mcap", DB, PICTURE)
"""What an earlier demo left behind, besides its truth."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(demo)


def demo(
    ctx: typer.Context,
    folder: Annotated[Path, typer.Option(metavar="DIR", help="Where recordings, map and picture go.")] = Path(
        "supermap-demo"
    ),
    seed: Annotated[int, typer.Option(min=0, help="Which world: each seed gives another one.")] = 1,
) -> None:
    """Simulate two visits to one place, map them, ask, compare, and hold the map against the truth."""
    check_folder(folder)
    shown = Shown(ctx.find_root().command, folder)
    began = time.monotonic()
    shown.simulate(seed)
    truth = shown.truth()
    shown.build(truth)
    shown.ask(truth)
    shown.compare(truth)
    shown.evaluate()
    shown.what_next(time.monotonic() - began)


def check_folder(folder: Path) -> None:
    """Raise `SimulationError` where the demo would overwrite what it has not made itself."""
    from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415 - keeps start-up light

    cure = "name another --folder"
    if (folder / TRUTH_FILE).exists():
        try:
            scenario = read_truth(folder / TRUTH_FILE).scenario
        except TruthError as error:
            raise SimulationError(f"{TRUTH_FILE} is not the demo's", where=str(folder), cure=cure) from error
        if scenario != SCENARIO:
            raise SimulationError(f"there is a world of its own: {scenario}", where=str(folder), cure=cure)
    elif there := [name for name in REPLACED if (folder / name).exists()]:
        raise SimulationError(f"{', '.join(there)} would be overwritten", where=str(folder), cure=cure)


def three_questions(truth: GroundTruth) -> tuple[str, ...]:
    """Of the truth's questions that have an answer: the count of most things, a relation, and one about the past of
    something that changed.
    """
    changed = {change.object_id for change in truth.changes}
    asked = sorted(
        (question for question in truth.questions if question.answer), key=lambda question: -len(question.answer)
    )
    past = [question for question in asked if changed.intersection(question.answer)]
    kinds = (
        (asked, (r"^how many",)),
        (asked, (r" near the ", r" (on|under|in) the ")),
        (past, (r"^where was", r" earlier$")),
    )
    found = (
        next((question.text for pattern in patterns for question in fitting if re.search(pattern, question.text)), None)
        for fitting, patterns in kinds
    )
    return tuple(text for text in found if text is not None)


def true_changes(truth: GroundTruth) -> str:
    """What became of the world's things, in plain words."""
    told = [_in_words(change, truth.object(change.object_id).label) for change in truth.changes]
    return f"In truth: {_listed(told) or 'nothing'}."


def comparison(scores: ChangeScores) -> str:
    """How much of what really changed the map reports, what it missed, and what it invented."""
    if scores.overall is None:
        return "The map holds one visit only: there is nothing to compare."
    found, missed, false = scores.overall.found, scores.missed, scores.false
    lines = [f"Held against the truth: the map found {found} of {found + len(missed)} true changes."]
    if missed:
        told = (f"{change.label} ({change.kind}{', told as two' * change.reported_as_two})" for change in missed)
        lines.append(f"It missed: {_listed(told)}.")
    if false:
        lines.append(
            f"It reports what did not happen so: {_listed(f'{change.label} ({change.kind})' for change in false)}."
        )
    if scores.unobservable:
        lines.append(f"Not judged, as no image shows it well: {_listed(scores.unobservable)}.")
    return " ".join(lines)


def answers_judged(asked: Sequence[str], estimate: EstimatedMap, truth: GroundTruth) -> str:
    """Which of the questions the map answered with exactly the right things; those that can be judged."""
    from supermap_cli.evaluation.answers import score_answers  # noqa: PLC0415 - keeps start-up light

    scores = score_answers(estimate, truth)
    asked = [text for text in asked if text not in scores.left_out]
    expected = {answer.text: answer.expected for answer in scores.wrong}
    wrong = [f'"{text}" (right: {", ".join(expected[text]) or "none"})' for text in asked if text in expected]
    if not asked:
        return "None of the questions above can be judged by what the images show."
    if not wrong:
        return f"It answered all {len(asked)} questions above right."
    return f"Of the {len(asked)} questions above it answered {len(wrong)} wrong: {_listed(wrong)}."


def _in_words(change: TrueChange, label: str) -> str:
    if change.kind == "moved":
        return f"the {label} was moved by {change.distance_m:.2f} m"
    return f"the {label} is gone" if change.kind == "disappeared" else f"a new {label} is there"


def _listed(parts: Iterable[str]) -> str:
    *all_but_last, last = parts or [""]
    return f"{', '.join(all_but_last)} and {last}" if all_but_last else last


@dataclass(frozen=True)
class Shown:
    """The demo's steps: each says what it is about, then runs commands just as they stand there."""

    supermap: Any
    folder: Path

    def simulate(self, seed: int) -> None:
        """A world, two recordings of it, and the truth."""
        self.say(
            "1. A world. A robot with a colour and a depth camera drives through one room on two days; in between "
            "things are taken away, brought and moved. What it records is what a real robot would: noisy depth, an "
            "odometry that drifts, a detector that misses and confuses. The exact truth goes into a file of its own."
        )
        self.run("simulate", SCENARIO, "--out", str(self.folder), "--seed", str(seed), "--overwrite")

    def build(self, truth: GroundTruth) -> None:
        """Both recordings into one map."""
        self._forget_the_last_map()
        self.say(
            "2. A memory. Both recordings go into one database, the second laid over the first by the walls and "
            "furniture that both saw. The truth is not looked at."
        )
        self.run("build", *(self.path(traversal.recording) for traversal in truth.traversals), "--db", self.path(DB))

    def ask(self, truth: GroundTruth) -> None:
        """Three questions: how many, where in relation to something, and of a time gone by."""
        self.say("3. Questions, in plain words. Every answer says where, since when, and on which images it rests.")
        for question in three_questions(truth):
            self.run("query", question, "--db", self.path(DB))

    def compare(self, truth: GroundTruth) -> None:
        """What changed: in truth, by the map, and how the two agree."""
        from supermap_cli.evaluation.changes import score_changes  # noqa: PLC0415 - keeps start-up light

        self.say(f"4. What changed? {true_changes(truth)}")
        self.say(
            "And what does the map say? A thing has disappeared only where its place was seen empty, and appeared only "
            "where its place had been seen empty before; what nobody looked at again is said to be just that."
        )
        self.run("diff", "--db", self.path(DB))
        estimate = self.estimate()
        self.say(comparison(score_changes(estimate, truth)))
        self.say(answers_judged(three_questions(truth), estimate, truth))

    def evaluate(self) -> None:
        """The map against the truth."""
        self.say("5. How good is all of the map? It is scored against the truth by the field's own metrics.")
        from supermap_cli.truth_file import TRUTH_FILE  # noqa: PLC0415 - keeps start-up light

        self.run("eval", "all", self.path(DB), self.path(TRUTH_FILE), "--plot", self.path(PICTURE))

    def what_next(self, seconds: float) -> None:
        """Where to go from here."""
        self.say(
            f"That was all of it, in {seconds / 60:.1f} minutes. {self.path(PICTURE)} shows the map over the truth."
        )
        self.say("Try next:")
        one = next((instance.id for instance in self.estimate().objects), None)
        about_one = (
            (f"supermap show {one}", "all about one object, with its relations"),
            (f"supermap history {one}", "where it stood when"),
        )
        typer.echo(f"  export SUPERMAP_DB={shlex.quote(self.path(DB))}")
        for command, what in (
            ("supermap show", "everything in the map now"),
            *(about_one if one is not None else ()),
            ("supermap demo --seed 2", "another world"),
            ("supermap simulate --help", "larger worlds, and one with a panorama camera and a LiDAR"),
            ("supermap inspect your-own.mcap", "what a build would use of your own recording"),
        ):
            typer.echo(f"  {command:<36} # {what}")

    def truth(self) -> GroundTruth:
        """What was simulated: the names of the recordings, and questions that have an answer."""
        from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415 - keeps start-up light

        return read_truth(self.folder / TRUTH_FILE)

    def estimate(self) -> EstimatedMap:
        """The map that was built, laid over the truth."""
        from supermap_cli.evaluation.reading import read_map  # noqa: PLC0415 - keeps start-up light
        from supermap_cli.truth_file import TRUTH_FILE  # noqa: PLC0415

        return read_map(self.path(DB), self.folder / TRUTH_FILE)[0]

    def path(self, name: str) -> str:
        """A file of the demo."""
        return str(self.folder / name)

    def say(self, text: str) -> None:
        """Explain, wrapped as a paragraph."""
        typer.echo("\n" + fill(text, 100))

    def run(self, *arguments: str) -> None:
        """Show a command as it would be typed, and run it in this process."""
        typer.echo(f"\n$ supermap {shlex.join(arguments)}")
        sys.stdout.flush()
        if status := self.supermap.main(args=list(arguments), prog_name="supermap", standalone_mode=False):
            raise typer.Exit(status)

    def _forget_the_last_map(self) -> None:
        for suffix in ("", "-wal", "-shm"):
            (self.folder / f"{DB}{suffix}").unlink(missing_ok=True)
