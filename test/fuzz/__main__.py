"""Run cases until it is stopped (Ctrl-C); what goes wrong is kept with its inputs."""

import argparse
import collections
import itertools
import secrets
import sys
from pathlib import Path

from . import live, runner


def main():
    """Run them."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--first", type=int, help="number of the first case (default: random)")
    parser.add_argument("--count", type=int, help="how many cases (default: until stopped)")
    parser.add_argument("--keep", default="fuzz_found", help="folder for the inputs of cases that "
                        "go wrong (default: %(default)s)")
    parser.add_argument("--live", action="store_true", help="models for a corrector at work, "
                        "instead of inputs for commands")
    parser.add_argument("--node", action="store_true", help="the same, for one node over DDS")
    chosen = parser.parse_args()
    first = secrets.randbits(40) if chosen.first is None else chosen.first
    numbers = itertools.count(first) if chosen.count is None else (
        range(first, first + chosen.count))
    counts = collections.Counter()

    def told(number, what, status, wrong):
        counts[f"{what}: {'wrong' if wrong else status}"] += 1
        if wrong:
            print(f"{number}: {what}: {'; '.join(wrong)}", flush=True)
        if sys.stderr.isatty():
            print(f"\r{counts.total()} cases", end="", file=sys.stderr)

    found = None
    try:
        if chosen.node:
            # needs rclpy
            from . import live_node
            found = live_node.run(numbers, Path(chosen.keep), told)
        else:
            found = runner.run(numbers, Path(chosen.keep), told,
                               live.judge if chosen.live else runner.judge)
    except KeyboardInterrupt:
        pass
    print(f"{counts.total()} cases from {first} on")
    for name, count in sorted(counts.items()):
        print(f"{count:8} {name}")
    return 1 if found or any("wrong" in name for name in counts) else 0


if __name__ == "__main__":
    sys.exit(main())
