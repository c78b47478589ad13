"""Measures the waypoints of `supermap navigate` on simulated worlds, by their truth: the table in docs/navigation.md.

    python tools/measure_waypoints.py FOLDER [--seeds 1,2,3] [--scenario office-twice]

FOLDER/office-twice-1 and so on are simulated, and mapped into FOLDER/office-twice-1.db, where they are missing.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from supermap_cli.evaluation.waypoints import score_waypoints
from supermap_cli.memory import open_store
from supermap_cli.simulation.scenarios import make_scenario
from supermap_cli.truth_file import read_truth


def supermap(*arguments: str) -> None:
    """Run the command line in a process of its own."""
    subprocess.run([sys.executable, "-m", "supermap_cli.main", *arguments], check=True)  # noqa: S603 - our own


def prepared(folder: Path, scenario: str, seed: int) -> tuple[Path, Path]:
    """The folder of a simulated scenario and the map of its recordings, made where they are missing."""
    recordings, db = folder / f"{scenario}-{seed}", folder / f"{scenario}-{seed}.db"
    if not (recordings / "truth.json").exists():
        supermap("simulate", scenario, "--seed", str(seed), "--out", str(recordings))
    if not db.exists():
        for recording in sorted(recordings.glob("*.mcap")):
            supermap("build", str(recording), "--db", str(db))
    return recordings, db


def main() -> None:
    """Print a line for each seed, and each waypoint that fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scenario", default="office-twice")
    parser.add_argument("--seeds", default="1,2,3")
    given = parser.parse_args()
    for seed in map(int, given.seeds.split(",")):
        recordings, db = prepared(given.folder, given.scenario, seed)
        truth, world = read_truth(recordings / "truth.json"), make_scenario(given.scenario, seed).world
        began = time.process_time()
        with open_store(str(db), read_only=True) as store, store.reader() as reader:
            scores = score_waypoints(reader, truth, world)
        n = len(scores.waypoints)
        print(
            f"| {seed} | {scores.goals} | {n} | {scores.free}/{n} | {scores.way_free}/{n} | {scores.seen}/{n} | "
            f"{min(each.clearance_m for each in scores.waypoints):.2f} | {time.process_time() - began:.0f} |",
            flush=True,
        )
        for each in scores.waypoints:
            if min(each.clearance_m, each.way_clearance_m) < scores.radius_m or not each.seen:
                print("    ", each)
        for text_id, why in scores.without_pose:
            print(f"     {text_id}: {why}")


if __name__ == "__main__":
    main()
