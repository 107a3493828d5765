"""Run the blind suite; what is done is kept, so that it can be stopped at any time.

``python -m blind``, with ``test`` and the repository's root on the path (`make blind` does so).
"""

import argparse
import hashlib
import json
import multiprocessing
import sys
from pathlib import Path

from tqdm import tqdm

from . import score
from .plan import GROUPS, plan
from .report import markdown
from .trial import run, warm_up

ROOT = Path(__file__).resolve().parents[2]


def main():
    """Run what is missing, then write the page."""
    parser = argparse.ArgumentParser(prog="blind", description=__doc__.splitlines()[0])
    parser.add_argument("groups", nargs="*", choices=[*GROUPS, "all"], default="all",
                        help="parts of the suite (default: %(default)s)")
    parser.add_argument("--seed-set", type=int, default=0,
                        help="which draws: none occurs in two sets (default: %(default)s)")
    parser.add_argument("--first", type=int, help="only so many draws of each cause")
    parser.add_argument("--limit", type=int, help="only so many cases in all")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default: %(default)s)")
    parser.add_argument("--output", type=Path, default=ROOT / "docs" / "blind.md")
    arguments = parser.parse_args()
    groups = GROUPS if "all" in arguments.groups else arguments.groups
    trials = plan(arguments.seed_set, groups, arguments.first)[:arguments.limit]
    kept = ROOT / "build" / "blind" / f"{sources_hash()}.jsonl"
    rows = completed(kept)
    missing = [trial for trial in trials if key(trial) not in rows]
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text("".join(json.dumps(row) + "\n" for row in rows.values()))
    # spawned: threads of numerical libraries do not survive a fork
    context = multiprocessing.get_context("spawn")
    with context.Pool(arguments.jobs, warm_up) as pool, open(kept, "a") as stream:
        done = pool.imap_unordered(run, missing)
        for row in tqdm(done, total=len(trials), initial=len(trials) - len(missing), unit="case"):
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            rows[row["name"], row["seed"]] = row
    command = f"python -m blind {' '.join(sys.argv[1:])}".strip()
    for row in (rows[key(trial)] for trial in trials):
        if score.right(row) is False:
            print(f"{row['name']} seed {row['seed']}: {row['error'] or row['verdict']}, named "
                  f"{', '.join(row['findings']) or 'nothing'}")
    page = markdown([rows[key(trial)] for trial in trials], command)
    arguments.output.write_text(page)
    print(f"{arguments.output}: written from {kept}")


def key(trial):
    """What tells a trial from all others."""
    return trial.name, trial.seed


def completed(path):
    """Rows of an earlier run of the same code; the last line may have been cut off."""
    rows = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            row = json.loads(line)
        except json.JSONDecodeError:
            continue
        rows[row["name"], row["seed"]] = row
    return rows


def sources_hash():
    """Results belong to the code that they came from."""
    folders = ROOT / "frac_accel", ROOT / "test" / "rig"
    paths = [path for folder in folders for path in folder.rglob("*.py")]
    digest = hashlib.sha256()
    blind = ROOT / "test" / "blind"
    for path in (*sorted(paths), blind / "plan.py", blind / "trial.py"):
        digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:12]


if __name__ == "__main__":
    main()
