"""Measure speed, latency and memory, each figure beside its peer in the same run.

Figures are only as good as the machine is quiet: what else it was busy with stands below the
table. Peers that are not installed are left out; pip install 'frac_accel[bench]' brings them.
"""

import contextlib
import importlib
import importlib.util
import os
import platform
import sys

from ..errors import FracAccelError
from ._common import add_json, progress, write_json

SUITES = {
    "kernel": "the correction in one process",
    "uncertainty": "the variance by the model's parameters, beside PyDynamic",
    "bag": "correct on a bag of a million messages, beside the mcap library",
    "live": "the corrector over DDS, beside relays; needs rclpy",
    "sensors": "a vehicle's rates, and many sensors in one process; needs rclpy",
}

EXAMPLES = """
frac_accel bench
frac_accel bench kernel bag --json bench.json
"""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("suites", nargs="*", metavar="SUITE",
                        help=", ".join(f"{name}: {what}" for name, what in SUITES.items())
                             + " (default: all)")
    parser.add_argument("--rounds", type=int, default=3, metavar="N",
                        help="repetitions, of which the median or the best counts "
                             "(default: %(default)s)")
    add_json(parser)


def run(arguments):
    """Do it."""
    if unknown := [name for name in arguments.suites if name not in SUITES]:
        raise FracAccelError(f"no suite {', '.join(unknown)}; there are {', '.join(SUITES)}")
    if arguments.rounds < 1:
        raise FracAccelError(f"--rounds: {arguments.rounds} given, expected at least 1")
    names, notes = arguments.suites or list(SUITES), []
    for name in {"live", "sensors"}.intersection(names):
        if importlib.util.find_spec("rclpy") is not None:
            continue
        if arguments.suites:
            raise FracAccelError(f"suite {name} needs rclpy (pip install 'frac_accel[ros]', or a "
                                 "sourced ROS 2)")
        names.remove(name)
        notes.append(f"{name}: not measured, rclpy is not installed")
    if "uncertainty" in names and importlib.util.find_spec("PyDynamic") is None:
        notes.append("uncertainty: PyDynamic is not installed, nothing to compare with")
    from ..bench.figures import table
    figures, before = [], os.getloadavg()
    with progress(len(names), "suite") as bar:
        for name in names:
            bar.set_description(name, refresh=False)
            figures += importlib.import_module(f"frac_accel.bench.{name}").run(
                arguments.rounds)
            bar.update()
    machine = {"cores": os.cpu_count(), "load_average_before": before,
               "load_average_after": os.getloadavg(), "python": platform.python_version(),
               "machine": platform.machine(), **_versions()}
    print("\n".join([*table(figures), *notes]))
    print(f"{machine['cores']} cores, load average {before[0]:.2f} before and "
          f"{machine['load_average_after'][0]:.2f} after")
    if before[0] > 0.5:
        print("The machine was not quiet: times are longer than they need be.", file=sys.stderr)
    write_json(arguments.json, {"figures": [figure.as_dict() for figure in figures],
                                "notes": notes, "machine": machine})


def _versions():
    from importlib.metadata import PackageNotFoundError, version
    result = {}
    for name in ("frac_accel", "numpy", "scipy", "mcap", "PyDynamic", "rclpy"):
        with contextlib.suppress(PackageNotFoundError):
            result[name] = version(name)
    return result
