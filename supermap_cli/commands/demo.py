"""`supermap demo`: the whole of it on a simulated place, explained."""

from __future__ import annotations

import re
import shlex
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from supermap_cli.types.truth import GroundTruth

EXAMPLES = """
Examples:

    supermap demo

    supermap demo --folder /tmp/demo --seed 7
"""
TRUTH, DB, PICTURE = "truth.json", "map.db", "evaluation.png"


def register(app: typer.Typer) -> None:
    """Add the command to the app."""
    app.command(epilog=EXAMPLES)(demo)


def demo(
    ctx: typer.Context,
    folder: Annotated[Path, typer.Option(metavar="DIR", help="Where recordings, map and picture go.")] = Path(
        "supermap-demo"
    ),
    seed: Annotated[int, typer.Option(help="Which world: each seed gives another one.")] = 1,
) -> None:
    """Simulate two visits to one place, map them, ask, compare, and hold the map against the truth."""
    shown = Shown(ctx.find_root().command, folder)
    began = time.monotonic()
    shown.simulate(seed)
    truth = shown.truth()
    shown.build(truth)
    shown.ask(truth)
    shown.compare()
    shown.evaluate()
    shown.what_next(time.monotonic() - began)


def three_questions(truth: GroundTruth) -> tuple[str, ...]:
    """Of the truth's questions that have an answer: the count of most things, a relation, and one about the past."""
    asked = sorted((each for each in truth.questions if each.answer), key=lambda each: -len(each.answer))
    kinds = ((r"^how many",), (r" near the ", r" (on|under|in) the "), (r"^where was", r" earlier$"))
    found = (
        next((each.text for pattern in patterns for each in asked if re.search(pattern, each.text)), None)
        for patterns in kinds
    )
    return tuple(text for text in found if text is not None)


@dataclass(frozen=True)
class Shown:
    """The demo's steps: each says what it is about, then runs commands just as they stand there."""

    supermap: Any
    folder: Path

    def simulate(self, seed: int) -> None:
        """A world, two recordings of it, and the truth."""
        self.say(
            "1. A world. A robot with a colour and a depth camera drives twice through the same rooms; in between "
            "things are taken away, brought and moved. What it records is what a real robot would: noisy depth, an "
            "odometry that drifts, a detector that misses and confuses. The exact truth goes into a file of its own."
        )
        self.run("simulate", "demo", "--out", str(self.folder), "--seed", str(seed), "--overwrite")

    def build(self, truth: GroundTruth) -> None:
        """Both recordings into one map."""
        self._forget_the_last_map()
        self.say(
            "2. A memory. Both recordings go into one database, the second laid over the first by the walls and "
            "furniture that both saw. The truth is not looked at."
        )
        self.run("build", *(self.path(each.recording) for each in truth.traversals), "--db", self.path(DB))

    def ask(self, truth: GroundTruth) -> None:
        """Three questions: how many, where in relation to something, and of a time gone by."""
        self.say("3. Questions, in plain words. Every answer says where, since when, and on which images it rests.")
        for question in three_questions(truth):
            self.run("query", question, "--db", self.path(DB))

    def compare(self) -> None:
        """What changed."""
        self.say(
            "4. What changed? A thing has disappeared only where its place was seen empty, and appeared only where its "
            "place had been seen empty before; what nobody looked at again is said to be just that."
        )
        self.run("diff", "--db", self.path(DB))

    def evaluate(self) -> None:
        """The map against the truth."""
        self.say("5. How good is all that? Now the truth comes in, and the map is scored by the field's own metrics.")
        self.run("eval", "all", self.path(DB), self.path(TRUTH), "--plot", self.path(PICTURE))

    def what_next(self, seconds: float) -> None:
        """Where to go from here."""
        self.say(
            f"That was all of it, in {seconds / 60:.1f} minutes. {self.path(PICTURE)} shows the map over the truth."
        )
        self.say("Try next:")
        for line in (
            f"export SUPERMAP_DB={shlex.quote(self.path(DB))}",
            "supermap show                        # everything in the map now",
            "supermap show chair-1                # all about one object, with its relations",
            "supermap history chair-1             # where it stood when",
            "supermap demo --seed 2               # another world",
            "supermap simulate --help             # larger worlds, and one with a panorama camera and a LiDAR",
            "supermap inspect your-own.mcap       # what a build would use of your own recording",
        ):
            typer.echo(f"  {line}")

    def truth(self) -> GroundTruth:
        """What was simulated: the names of the recordings, and questions that have an answer."""
        from supermap_cli.truth_file import read_truth  # noqa: PLC0415 - keeps start-up light

        return read_truth(self.folder / TRUTH)

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
