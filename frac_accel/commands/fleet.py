"""Put many bags through a command: on the cores of this machine, or on a cluster.

One row a bag and axis in Parquet below RESULTS/COMMAND/, partitioned by date; corrected bags,
models, results and pages in RESULTS/COMMAND-files/; RESULTS/COMMAND.html shows the fleet at a
glance. A bag is done once, by its content: the same command goes on where it was stopped. A bag
that fails is a row with its error, and exit status 4.
"""

import contextlib
import contextvars
import os

from ..errors import FracAccelError
from ..fleet.places import find_bags, output_at
from ..fleet.workers import Cluster, LocalCores, Named
from ..io.outputs import say
from ..io.topics import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC
from ._common import STRUCTURES, add_filter, add_temperature, add_topics, positive, progress
from ._fleet_row import row
from .parser import Parser

__all__ = ["EXAMPLES", "add_arguments", "row", "run"]

EXAMPLES = """
frac_accel fleet diagnose drives/ -o results --model sensor.yaml --columns vehicles.csv
frac_accel fleet correct 'drives/*.mcap' -o results --model sensor.yaml --workers 2
frac_accel fleet identify benches/ -o results --axis xyz
frac_accel fleet validate drives/ -o results --model sensor.yaml
"""

SOME_FAILED = 4
"""Exit status where some bags failed and the others are done."""

_MEMORY_MB = 1500.0


def add_arguments(parser):
    """Options of the verb."""
    verbs = parser.add_subparsers(dest="each", metavar="COMMAND", required=True,
                                  parser_class=Parser)
    for verb, add in (("diagnose", _add_diagnose), ("correct", _add_correct),
                      ("identify", _add_identify), ("validate", _add_validate)):
        sub = verbs.add_parser(verb, help=f"{verb} every bag")
        sub.exemplify("\n".join(line for line in EXAMPLES.splitlines() if f" {verb} " in line))
        _add_common(sub)
        add(sub.add_argument_group(f"as for frac_accel {verb}"))


def _add_common(parser):
    parser.add_argument("bags", metavar="BAG", nargs="+",
                        help="bag, folder of bags, pattern with *, or a URL that fsspec knows")
    parser.add_argument("-o", "--results", required=True, metavar="RESULTS",
                        help="folder, here or in an object store")
    parser.add_argument("--columns", metavar="TABLE.csv",
                        help="what is known of the bags: a table with a column bag (name or path) "
                             "and any others, such as vehicle, sensor_type, lot, firmware, "
                             "mileage; vehicle says which bags are of one, model gives a bag its "
                             "own sensor model")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), metavar="N",
                        help="processes on this machine (default: its cores)")
    parser.add_argument("--memory", type=positive, default=_MEMORY_MB, metavar="MB",
                        help="most private memory of each of them (default: %(default)g)")
    parser.add_argument("--scheduler", metavar="tcp://…",
                        help="Dask scheduler that has the workers instead")
    parser.add_argument("--map", metavar="MODULE:FUNCTION",
                        help="or a function that maps frac_accel.commands.fleet.row over a list")


def _add_diagnose(parser):
    parser.add_argument("--model", metavar="M.yaml", help="model in use, of all bags")
    parser.add_argument("--axis", default="x", metavar="AXES",
                        help="one or more of x, y, z (default: %(default)s)")
    add_topics(parser, axis=False)
    add_temperature(parser)
    parser.add_argument("--noise-std", type=positive, metavar="STD")
    parser.add_argument("--time-limit", type=positive, default=60.0, metavar="SECONDS")
    parser.add_argument("--no-pages", dest="pages", action="store_false",
                        help="draw no page for the bags in which something is found (5 MB each)")


def _add_correct(parser):
    parser.add_argument("--model", metavar="M.yaml", help="sensor model of all bags")
    add_topics(parser, axis=False)
    add_temperature(parser)
    add_filter(parser)


def _add_identify(parser):
    parser.add_argument("--structure", choices=STRUCTURES, default="auto")
    parser.add_argument("--axis", default="x", metavar="AXES",
                        help="one or more of x, y, z (default: %(default)s)")
    add_topics(parser, axis=False)


def _add_validate(parser):
    parser.add_argument("--axis", default="x", metavar="AXES",
                        help="one or more of x, y, z (default: %(default)s)")
    _add_correct(parser)


def run(arguments):
    """Do it."""
    try:
        import fsspec  # noqa: F401

        from ..fleet.plan import Models, Plan, Table, known_bags
        from ..fleet.store import Store
    except ModuleNotFoundError as error:
        raise FracAccelError(f"the Python library {error.name} is missing; install it with "
                             "pip install 'frac_accel[fleet]'") from None
    _require_utf_8([arguments.results, arguments.columns or ""])
    if arguments.workers < 1:
        raise FracAccelError(f"--workers: {arguments.workers} given, expected at least 1")
    axes = _axes(arguments)
    bags = find_bags(arguments.bags)
    _require_utf_8([bag.url for bag in bags])
    table = Table(arguments.columns, bags)
    models = Models(getattr(arguments, "model", None), table)
    if arguments.each in ("correct", "validate") and not all(
            models.of(bag.url)[0] for bag in bags):
        raise FracAccelError("--model: missing, expected one for all bags, or a column model of "
                             "--columns for each")
    with Store(arguments.results, arguments.each, table.names) as store, _workers(arguments) as who:
        rows = store.read(["bag", "size_bytes", "changed", "sha256", "start_ns", "frame", "error",
                           "axis", "job"]).to_pylist()
        plan = Plan(arguments.each, _options(arguments), axes, arguments.results,
                    getattr(arguments, "pages", False), table, models,
                    {(entry["sha256"] or entry["bag"], entry["axis"], entry["job"])
                     for entry in rows})
        tasks = plan.tasks(_inspected(arguments, bags, known_bags(rows), who))
        failed = _done(store, who, tasks)
        store.flush()
        say(_summary(arguments, len(bags), len(tasks), failed))
        seen = _overview(arguments, store, {plan.job(models.of(bag.url)[1]) for bag in bags})
    return SOME_FAILED if seen.failed else 0


def _require_utf_8(names):
    """Rows are text as everybody can read it."""
    for name in names:
        try:
            name.encode()
        except UnicodeEncodeError:
            raise FracAccelError(f"{name}: a name that is not UTF-8, which no row can hold; rename "
                                 "it") from None


def _axes(arguments):
    axes = [axis for axis in getattr(arguments, "axis", "") if axis != ","]
    if not set(axes) <= set("xyz") or len(set(axes)) < len(axes):
        raise FracAccelError(f"--axis: {arguments.axis!r} given, expected one or more of x, y, z")
    return axes or [""]


def _workers(arguments):
    """Who does the work, as long as it is entered."""
    if arguments.scheduler and arguments.map:
        raise FracAccelError("--scheduler and --map are both given, expected one")
    if arguments.scheduler:
        return Cluster(arguments.scheduler)
    if arguments.map:
        return contextlib.nullcontext(Named(arguments.map))
    return contextlib.nullcontext(LocalCores(arguments.workers, arguments.memory))


def _options(arguments):
    """The single verb's options that were given, but for its axis, model and outputs."""
    defaults = {"reference": REFERENCE_TOPIC, "sensor": RAW_TOPIC, "temperature": TEMPERATURE_TOPIC,
                "structure": "auto"}
    names = ("reference", "sensor", "temperature", "noise_std", "time_limit", "structure",
             "sample_rate", "bandwidth", "lowest", "max_delay", "tolerance")
    line = []
    for name in names:
        value = getattr(arguments, name, None)
        if value is not None and value != defaults.get(name):
            line += [f"--{name.replace('_', '-')}", str(value)]
    return line


def _inspected(arguments, bags, known, who):
    """What the bags are; those that have not changed since their rows are not read again."""
    from ..fleet.inspection import inspect
    found, unknown = [], {}
    for bag in bags:
        seen = known.get((bag.url, bag.size, bag.changed))
        if seen is not None:
            found.append({**seen, "size_bytes": bag.size, "changed": bag.changed})
        else:
            unknown[bag.url] = bag
    requests = [{"bag": url, "sensor": arguments.sensor} for url in unknown]
    with progress(len(requests), unit="bag") as bar:
        bar.set_description("reading", refresh=False)
        for request, seen in who.run(inspect, requests):
            bag = unknown[request["bag"]]
            seen = seen or {"bag": bag.url, "sha256": "", "date": "unknown", "start_ns": None,
                            "frame": "", "error": "its workers died while they read it"}
            found.append({**seen, "size_bytes": bag.size, "changed": bag.changed})
            bar.update()
    return found


def _done(store, who, tasks):
    """Number of bags that failed, once all tasks have their rows."""
    failed, runnable = 0, []
    for task in tasks:
        if task["error"]:
            failed += 1
            store.add(_failed(task, task["error"]), task["date"])
        else:
            runnable.append(task)
    with progress(len(runnable), unit="bag") as bar:
        for task, told in who.run(row, runnable):
            told = told or _failed(task, "its workers died while they worked on it: is it too "
                                         "large for their memory?")
            if told["is_fatal"]:
                raise FracAccelError(f"{told['error']}; the rows so far are kept, and the same "
                                     "command goes on from there")
            failed += bool(told["error"])
            store.add(told, task["date"])
            bar.update()
    return failed


def _failed(task, error):
    return {**task["carried"], "bag": task["bag"], "verb": task["verb"], "axis": task["axis"],
            "error": error, "is_fatal": False}


def _summary(arguments, bags, tasks, failed):
    words = f"{arguments.results}: {bags} bags, {tasks} rows new"
    return f"{words}, {failed} of them with an error" if failed else words


def _overview(arguments, store, jobs):
    """What the fleet shows, as text and page; an `Overview`."""
    from ..fleet.overview import overview
    from ..report.fleet import fleet_page
    seen = overview(store.read(), store.given, jobs)
    for line in seen.words:
        say(line)
    page = fleet_page(seen, f"frac_accel fleet {arguments.each}")
    with output_at(f"{arguments.results}/{arguments.each}.html") as path:
        # it goes to its place while it is at hand, not with the outputs of other commands
        contextvars.Context().run(page.write, path)
    say(f"{arguments.results}/{arguments.each}.html: written")
    return seen
