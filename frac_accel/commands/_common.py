"""What the verbs share: options, results as files, progress.

What a verb works with is imported where it works: help and completion need none of it.
"""

import argparse
import contextlib
import json
import math
import os
import re
import sys
import threading
from pathlib import Path

from ..errors import BagError, DesignError, FracAccelError
from ..io.outputs import guard, say, sweep, write_text
from ..io.regular_file import sha256_of
from ..io.topics import RAW_TOPIC, REFERENCE_TOPIC, TEMPERATURE_TOPIC
from ..report import require_plotly

# Those of `identification`, whose import takes half a second.
STRUCTURES = ("auto", "classical", "arx", "oscillator", "fractional", "gain",
              "fractional_transfer_function")
BAG_HELP = ".mcap file or rosbag2 folder, or .db3, .csv, .parquet, .mf4, .npz (see convert)"
_NUMBERS = re.compile(r"\[([-+.\deEnul,\s]*)\]")
# Time [s] after which a bar is drawn anew without a step.
_TICK_S = 0.5
# What the options of `add_filter` are called where a library's error names them.
_OF_WISHES = {"bandwidth_hz": "--bandwidth", "lowest_hz": "--lowest", "max_delay_s": "--max-delay",
              "tolerance=": "--tolerance "}
# Options that name files, of all verbs.
INPUTS = ("bag", "bags", "inputs", "model", "result")
OUTPUTS = ("output", "extended_model", "report", "json")


def add_bag(parser):
    """The bag that a verb reads."""
    parser.add_argument("bag", metavar="BAG", help=BAG_HELP)


def add_model(parser):
    """The model that a verb uses."""
    parser.add_argument("--model", required=True, metavar="M.yaml", help="sensor model")


def add_topics(parser, axis=True):
    """Which topics and which axis of the bag hold the pair."""
    parser.add_argument("--reference", default=REFERENCE_TOPIC, metavar="TOPIC",
                        help="topic of the reference (default: %(default)s)")
    parser.add_argument("--sensor", default=RAW_TOPIC, metavar="TOPIC",
                        help="topic of the sensor (default: %(default)s)")
    if axis:
        parser.add_argument("--axis", default="x", choices=list("xyz"),
                            help="axis that is judged (default: %(default)s)")


def add_temperature(parser):
    """Which topic holds the temperature."""
    parser.add_argument("--temperature", default=TEMPERATURE_TOPIC, metavar="TOPIC",
                        help="topic of the sensor's temperature, for models that depend on it "
                             "(default: %(default)s)")


def read_temperature_at(reader, topic):
    """`Temperature` of a topic: a function of stamps [ns] that gives °C.

    Raises
    ------
    BagError
        If the bag has no such topic, or nothing usable on it.
    """
    import numpy as np

    from ..record import Temperature
    blocks = list(reader.temperatures(topic))
    stamps, celsius = (np.concatenate([np.empty(0, dtype), *(getattr(block, name)
                                                             for block in blocks)])
                       for name, dtype in (("stamps_ns", np.int64), ("celsius", float)))
    try:
        return Temperature(stamps, celsius)
    except FracAccelError:
        raise BagError(f"{reader.path}: topic {topic} has no usable temperature") from None


def add_filter(parser):
    """Wishes for the inverse filter."""
    parser.add_argument("--sample-rate", type=positive, metavar="HZ",
                        help="sampling rate (default: estimated from the stamps)")
    parser.add_argument("--bandwidth", type=positive, metavar="HZ",
                        help="highest frequency to correct (default: the model's band, or where "
                             "the sensor has lost 80 %% of its gain)")
    parser.add_argument("--lowest", type=positive, metavar="HZ",
                        help="lowest frequency to correct (default: 0, or where a high-pass has "
                             "lost 80 %% of its gain)")
    parser.add_argument("--max-delay", type=positive, metavar="S",
                        help="permitted delay of the filter (default: at most four periods of the "
                             "highest frequency)")
    parser.add_argument("--tolerance", type=positive, metavar="SHARE",
                        help="permitted worst relative error of the filter in its band "
                             "(default: 0.002)")


def filter_wishes(arguments):
    """Those wishes as keywords of `Corrector`."""
    wishes = {"sampling_rate_hz": arguments.sample_rate or 0.0, "bandwidth_hz": arguments.bandwidth,
              "lowest_hz": arguments.lowest, "max_delay_s": arguments.max_delay}
    return wishes if arguments.tolerance is None else {**wishes, "tolerance": arguments.tolerance}


def one_line(error):
    """A library's error as a command says it: of a filter, options in place of keywords."""
    words = str(error)
    if isinstance(error, DesignError):
        for wish, option in _OF_WISHES.items():
            words = words.replace(f"{wish}=", f"{option} ").replace(wish, option)
    return " ".join(words.split())


def add_json(parser):
    """Machine-readable result."""
    parser.add_argument("--json", metavar="FILE", help="also write the result as JSON")


def add_report(parser):
    """Result as a page."""
    parser.add_argument("--report", metavar="R.html",
                        help="also write the result as one HTML page with interactive figures")


def positive(text):
    """Type of an option: a finite number above 0."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} given, expected a number above 0")
    return value


def write_json(path, result):
    """Write a result; numbers that are none (NaN) become null, as JSON knows no other way."""
    if path is None:
        return
    from ..model.parameters import plain
    text = json.dumps(_without_nan(plain(result)), indent=1, allow_nan=False)
    # a list of numbers is one line, not one for each
    text = _NUMBERS.sub(lambda found: f"[{' '.join(found[1].split())}]", text)
    try:
        write_text(path, text + "\n")
    except OSError as error:
        raise FracAccelError(f"{path}: cannot write the result: {error.strerror}") from None


def open_bag(path):
    """BagReader whose damage is told at once."""
    from ..io.bag import BagReader
    reader = BagReader(path)
    for warning in reader.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    return reader


def guard_files(arguments):
    """Refuse options whose output is one of the inputs or another output."""
    inputs, outputs = _files(arguments, INPUTS), _files(arguments, OUTPUTS)
    for folder in {os.path.dirname(os.path.abspath(file)) for file in [*inputs, *outputs]}:
        # what a killed run was about to name
        sweep(folder)
    guard(outputs, inputs)


def _files(arguments, options):
    named = [vars(arguments).get(option) for option in options]
    return [file for entry in named if entry is not None
            for file in ([entry] if isinstance(entry, str) else entry)]


def require_report(path):
    """Refuse a report that could not be made, before the work that it is to tell of."""
    if path is not None:
        require_plotly()


def write_page(page, path):
    """Write a report, and say so."""
    page.write(path)
    say(f"{path}: written")


def progress(total, unit="msg"):
    """Bar on standard error, where that is a terminal, that shows after two seconds."""
    from tqdm import tqdm
    return tqdm(total=total, unit=unit, delay=2, leave=False, file=sys.stderr, unit_scale=True,
                disable=None)


@contextlib.contextmanager
def share_done():
    """The same of work whose share that is done is known: a function of words and that share."""
    from tqdm import tqdm
    # the pace since the start tells the time left, as the last step alone would not
    # any step is drawn: left to itself, tqdm waits for one as large as the largest so far
    with tqdm(total=100, delay=2, leave=False, file=sys.stderr, disable=None, smoothing=0,
              miniters=0, bar_format="{desc}: {percentage:.0f} % done{bar:20} {elapsed}, about "
                                     "{remaining} left") as bar, _ticking(bar):
        def show(words, share):
            bar.set_description_str(words, refresh=False)
            bar.update(max(0, round(100 * share) - bar.n))
        yield show


@contextlib.contextmanager
def _ticking(bar):
    """Draw a bar anew while no step comes, so that nobody takes a long one for a standstill."""
    over = threading.Event()

    def tick():
        while not over.wait(_TICK_S):
            bar.update(0)

    if bar.disable:
        yield
        return
    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def printable(name):
    """A name of a file as text that any file of ours can hold."""
    return name.encode("utf-8", "backslashreplace").decode("utf-8")


def provenance(bag, command):
    """Where a result comes from: the bag, its content's hash, the command and our version."""
    from .. import __version__
    path = Path(bag)
    files = sorted([*path.glob("*.mcap"), *path.glob("*.db3*")]) if path.is_dir() else [path]
    return {"bag": printable(path.name), "sha256": sha256_of(*files),
            "command": printable(command), "frac_accel_version": __version__}


def _without_nan(value):
    if isinstance(value, dict):
        return {str(key): _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
