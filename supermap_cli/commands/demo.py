"""`supermap demo`: simulate, build, query, compare and evaluate one place, with explanations."""

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

from supermap_cli.commands.whole_numbers import whole
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
DB, PLOT = "map.db", "evaluation.png"
SCENARIO = "demo"
OVERWRITTEN = ("monday.mcap", "tuesday.mcap", DB, PLOT)
"""Files of an earlier demo that are overwritten, besides its truth."""


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(demo)


def demo(
    ctx: typer.Context,
    folder: Annotated[Path, typer.Option(metavar="DIR", help="Where recordings, map and picture go.")] = Path(
        "supermap-demo"
    ),
    seed: Annotated[int, typer.Option(min=0, callback=whole, help="Which world: each seed gives another one.")] = 1,
) -> None:
    """Simulate two visits to one place, map them, ask, compare, and hold the map against the truth."""
    check_folder(folder)
    remove_old_map(folder)
    run = DemoRun(ctx.find_root().command, folder)
    began = time.monotonic()
    run.simulate(seed)
    truth = run.truth()
    run.build(truth)
    run.ask(truth)
    run.compare(truth)
    run.evaluate()
    run.next_steps(time.monotonic() - began)


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
    elif there := [name for name in OVERWRITTEN if (folder / name).exists()]:
        raise SimulationError(f"{', '.join(there)} would be overwritten", where=str(folder), cure=cure)


def remove_old_map(folder: Path) -> None:
    """Remove the map of an earlier demo. Raises `MemoryStoreError` where it holds anything else."""
    from supermap_cli.evaluation.pairing import true_traversals  # noqa: PLC0415 - keeps start-up light
    from supermap_cli.memory import open_store  # noqa: PLC0415
    from supermap_cli.output_files import check_output  # noqa: PLC0415
    from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415

    check_output(folder / PLOT, "png", option="--folder")
    if (folder / DB).exists():
        truth = read_truth(folder / TRUTH_FILE)
        with open_store(str(folder / DB), create=True) as store:
            store.remove(lambda traversal: true_traversals(traversal, truth))


def example_questions(truth: GroundTruth) -> tuple[str, ...]:
    """Of the truth's questions that have an answer: the count of most things, a relation, and one about the past of
    something that changed.
    """
    changed = {change.object_id for change in truth.changes}
    questions = sorted(
        (question for question in truth.questions if question.answer), key=lambda question: -len(question.answer)
    )
    past = [question for question in questions if changed.intersection(question.answer)]
    kinds = (
        (questions, (r"^how many",)),
        (questions, (r" near the ", r" (on|under|in) the ")),
        (past, (r"^where was", r" earlier$")),
    )
    texts = (
        next(
            (question.text for pattern in patterns for question in candidates if re.search(pattern, question.text)),
            None,
        )
        for candidates, patterns in kinds
    )
    return tuple(text for text in texts if text is not None)


def true_change_summary(truth: GroundTruth) -> str:
    """The true changes in plain words."""
    described = [_describe_change(change, truth.object(change.object_id).label) for change in truth.changes]
    return f"In truth: {_enumerated(described) or 'nothing'}."


def change_summary(scores: ChangeScores) -> str:
    """How many true changes the map reports, which it missed, and which reports are false."""
    if scores.overall is None:
        return "The map holds one visit only: there is nothing to compare."
    found, missed, false = scores.overall.found, scores.missed, scores.false
    lines = [f"Held against the truth: the map found {found} of {found + len(missed)} true changes."]
    if missed:
        described = (f"{change.label} ({change.kind}{', told as two' * change.reported_as_two})" for change in missed)
        lines.append(f"It missed: {_enumerated(described)}.")
    if false:
        lines.append(
            f"It reports what did not happen so: {_enumerated(f'{change.label} ({change.kind})' for change in false)}."
        )
    if scores.unobservable:
        lines.append(f"Not judged, as no image shows it well: {_enumerated(scores.unobservable)}.")
    return " ".join(lines)


def answer_summary(questions: Sequence[str], estimate: EstimatedMap, truth: GroundTruth) -> str:
    """Which of the questions the map answered with exactly the right objects, of those that can be scored."""
    from supermap_cli.evaluation.answers import score_answers  # noqa: PLC0415 - keeps start-up light

    scores = score_answers(estimate, truth)
    questions = [text for text in questions if text not in scores.left_out]
    expected = {answer.text: answer.expected for answer in scores.wrong}
    wrong = [f'"{text}" (right: {", ".join(expected[text]) or "none"})' for text in questions if text in expected]
    if not questions:
        return "None of the questions above can be judged by what the images show."
    if not wrong:
        return f"It answered all {len(questions)} questions above right."
    return f"Of the {len(questions)} questions above it answered {len(wrong)} wrong: {_enumerated(wrong)}."


def _describe_change(change: TrueChange, label: str) -> str:
    if change.kind == "moved":
        return f"the {label} was moved by {change.distance_m:.2f} m"
    return f"the {label} is gone" if change.kind == "disappeared" else f"a new {label} is there"


def _enumerated(parts: Iterable[str]) -> str:
    *all_but_last, last = parts or [""]
    return f"{', '.join(all_but_last)} and {last}" if all_but_last else last


@dataclass(frozen=True)
class DemoRun:
    """The steps of the demo: each explains itself, then runs the commands that it prints."""

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
        self.say(
            "2. A memory. Both recordings go into one database, the second laid over the first by the walls and "
            "furniture that both saw. The truth is not looked at."
        )
        self.run("build", *(self.path(traversal.recording) for traversal in truth.traversals), "--db", self.path(DB))

    def ask(self, truth: GroundTruth) -> None:
        """Three questions: a count, a relation, and one about the past."""
        self.say("3. Questions, in plain words. Every answer says where, since when, and on which images it rests.")
        for question in example_questions(truth):
            self.run("query", question, "--db", self.path(DB))

    def compare(self, truth: GroundTruth) -> None:
        """The changes: the true ones, those that the map reports, and how the two agree."""
        from supermap_cli.evaluation.changes import score_changes  # noqa: PLC0415 - keeps start-up light

        self.say(f"4. What changed? {true_change_summary(truth)}")
        self.say(
            "And what does the map say? A thing has disappeared only where its place was seen empty, and appeared only "
            "where its place had been seen empty before; what nobody looked at again is said to be just that."
        )
        self.run("diff", "--db", self.path(DB))
        estimate = self.estimate()
        self.say(change_summary(score_changes(estimate, truth)))
        self.say(answer_summary(example_questions(truth), estimate, truth))

    def evaluate(self) -> None:
        """The map against the truth."""
        self.say("5. How good is all of the map? It is scored against the truth by the field's own metrics.")
        from supermap_cli.truth_file import TRUTH_FILE  # noqa: PLC0415 - keeps start-up light

        self.run("eval", "all", self.path(DB), self.path(TRUTH_FILE), "--plot", self.path(PLOT))

    def next_steps(self, seconds: float) -> None:
        """Print commands to try next."""
        self.say(f"That was all of it, in {seconds / 60:.1f} minutes. {self.path(PLOT)} shows the map over the truth.")
        self.say("Try next:")
        instance_id = next((instance.id for instance in self.estimate().objects), None)
        object_commands = (
            (f"supermap show {instance_id}", "all about one object, with its relations"),
            (f"supermap history {instance_id}", "where it stood when"),
        )
        typer.echo(f"  export SUPERMAP_DB={shlex.quote(self.path(DB))}")
        for command, what in (
            ("supermap show", "everything in the map now"),
            *(object_commands if instance_id is not None else ()),
            ("supermap demo --seed 2", "another world"),
            ("supermap simulate --help", "larger worlds, and one with a panorama camera and a LiDAR"),
            ("supermap inspect your-own.mcap", "what a build would use of your own recording"),
        ):
            typer.echo(f"  {command:<36} # {what}")

    def truth(self) -> GroundTruth:
        """The truth of the simulated place."""
        from supermap_cli.truth_file import TRUTH_FILE, read_truth  # noqa: PLC0415 - keeps start-up light

        return read_truth(self.folder / TRUTH_FILE)

    def estimate(self) -> EstimatedMap:
        """The map that was built, aligned with the truth."""
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
