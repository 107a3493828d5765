"""Convert records between MCAP, rosbag2's sqlite3, CSV, Parquet, MDF4 and numpy.

The name of OUT says which: .mcap, .db3, .csv, .parquet, .mf4, .npz, or a new rosbag2 folder. The
other commands read all of these as they are, where the columns of a table are named as topics
(/imu/reference/x [m/s^2], and time [s] beside it). Where they are not, --map, --unit and --time say
here which is which.

Of several inputs all topics come together, by their stamps. TOPIC=FILE says which topic the columns
x, y, z of a file are.
"""

import argparse
import dataclasses
import re
from pathlib import Path

from ..io.outputs import guard
from ._common import add_json, positive, write_json

_TOPIC = re.compile(r"(?P<topic>/[\w/]+)=(?P<rest>.+)")

EXAMPLES = """
frac_accel convert drive.db3 -o drive.mcap
frac_accel convert drive.csv -o drive.mcap --map /imu/reference=ref --map /imu/data_raw=ax --unit g
frac_accel convert /imu/reference=a.npy /imu/data_raw=b.npy -o pair.mcap --rate 100 --unit g
"""


def add_arguments(parser):
    """Options of the verb."""
    parser.add_argument("inputs", metavar="[TOPIC=]FILE", nargs="+", help="file or rosbag2 folder")
    parser.add_argument("-o", "--output", required=True, metavar="OUT", help="file to write")
    parser.add_argument("--map", metavar="TOPIC=X[,Y[,Z]]", action="append", default=[],
                        type=_mapped, help="columns of a topic's axes; - for one that there is not")
    parser.add_argument("--unit", metavar="[TOPIC=]UNIT", action="append", default=[], type=_unit,
                        help="unit of these columns (m/s^2, g, mg, V, counts), where they state "
                             "none or a wrong one")
    parser.add_argument("--time", metavar="COLUMN", default="", help="column of the time")
    parser.add_argument("--time-unit", metavar="UNIT", default="", choices=["s", "ms", "us", "ns"],
                        help="its unit: s, ms, us or ns")
    parser.add_argument("--rate", metavar="HZ", type=positive, default=0.0,
                        help="sampling rate of a table without a column of time")
    add_json(parser)


def run(arguments):
    """Do it."""
    from ..io.formats import Wishes, convert, split_unit
    files = [_TOPIC.fullmatch(name) or name for name in arguments.inputs]
    files = [(file["topic"], file["rest"]) if isinstance(file, re.Match) else ("", file)
             for file in files]
    guard([arguments.output], [file for _, file in files])
    wishes = Wishes(dict(arguments.map), dict(arguments.unit), split_unit(arguments.time)[0],
                    arguments.time_unit, arguments.rate)
    sources = [_open(file, topic, wishes) for topic, file in files]
    written, left_out = convert(sources, arguments.output)
    for source, (_, file) in zip(sources, files):
        for warning in source.warnings:
            print(f"warning: {warning.replace(str(source.path), file)}")
    print(f"{arguments.output}: " + ", ".join(f"{count} messages of {name}"
                                              for name, count in written.items()))
    if left_out:
        print(f"not in a table, and left out: {', '.join(left_out)}")
    write_json(arguments.json, {"output": str(arguments.output), "messages": written,
                                "left_out": left_out})


def _open(file, topic, wishes):
    from ..io.bag import BagReader
    from ..io.formats import as_mcap
    if topic:
        wishes = dataclasses.replace(wishes, topic=topic)
    if not Path(file).exists():
        return BagReader(file)
    return BagReader(as_mcap(file, wishes))


def _mapped(text):
    from ..io.formats import split_unit
    found = _TOPIC.fullmatch(text)
    names = [split_unit(name.strip())[0] for name in found["rest"].split(",")] if found else []
    if not 1 <= len(names) <= 3 or not all(names):
        raise argparse.ArgumentTypeError(f"{text!r} given, expected /TOPIC=X or /TOPIC=X,Y,Z with "
                                         "the names of columns")
    return found["topic"], tuple(names)


def _unit(text):
    found = _TOPIC.fullmatch(text)
    return (found["topic"], found["rest"]) if found else ("", text)
