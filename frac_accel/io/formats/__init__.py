"""Other formats than MCAP, each by the library that knows it: all become bags, and come from bags.

What is read is first made an MCAP file, so that there is one road for every command: `as_mcap`.
"""

import atexit
import contextlib
import heapq
import importlib
import shutil
import sqlite3
import tempfile
from pathlib import Path

import numpy as np

from ...errors import BagError
from ..outputs import at_once, stage
from ..regular_file import open_regular
from ..samples import Correlated
from .columns import Wishes, split_unit, topics_of
from .rosbag2 import is_sqlite, read_messages, write_sqlite

__all__ = ["TABLES", "Wishes", "as_mcap", "convert", "format_of", "split_unit"]

TABLES = {".csv": "csv", ".tsv": "csv", ".txt": "csv", ".parquet": "parquet", ".pq": "parquet",
          ".npz": "npz", ".npy": "npy", ".mf4": "mdf", ".mdf": "mdf"}
"""Tables by the ends of their names."""

_MODULES = {"csv": "arrow", "parquet": "arrow", "npz": "numpy_file", "npy": "numpy_file",
            "mdf": "mdf"}
_HELP = "pip install 'frac_accel[formats]'"
_made = {}


def format_of(path):
    """Format of what is no plain MCAP: "rosbag2" or one of `TABLES`; None of anything else."""
    path = Path(path)
    if path.is_dir():
        return "rosbag2" if not any(path.glob("*.mcap")) and any(path.glob("*.db3*")) \
            or any(path.glob("*.zstd")) else None
    if path.suffix.lower() in TABLES:
        return TABLES[path.suffix.lower()]
    return "rosbag2" if is_sqlite(path) else None


def as_mcap(path, wishes=None):
    """Path of an MCAP file with what is in a file of another format; it lives as long as we do.

    Raises
    ------
    BagError
        If it cannot be read, or the library that can is missing; says what helps.
    """
    path = Path(path)
    kind = format_of(path)
    if kind is None:
        return path
    try:
        status = path.stat()
        if not path.is_dir():
            open_regular(path).close()
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror}") from None
    key = path.resolve(), status.st_mtime_ns, status.st_size, repr(wishes)
    if key not in _made:
        target = _folder() / f"{len(_made)}.mcap"
        with _known_library(path), at_once():
            if kind == "rosbag2":
                _write_messages(target, *read_messages(_single(path), path))
            else:
                from ..bag import write_bag
                write_bag(target, topics_of(_read_table(kind, path), wishes or Wishes(), path))
        _made[key] = target
    return _made[key]


def convert(sources, target):
    """Write all topics of bags to one file, in the format of its name.

    Parameters
    ----------
    sources : list of BagReader
    target : str or Path

    Returns
    -------
    written, left_out : dict of str to int
        Messages by topic; a table takes those of acceleration and temperature only.

    Raises
    ------
    BagError
        If a topic is in two of them, or the target cannot be written.
    """
    target = Path(target)
    if target.suffix.lower() not in ("", ".mcap", ".db3", *TABLES) \
            or target.suffix.lower() == ".npy":
        raise BagError(f"{target}: is of no format that can be written, expected a name that ends "
                       "in .mcap, .db3, .csv, .parquet, .npz or .mf4, or a new folder")
    infos = [info for source in sources for info in source.topics.values() if info.count]
    names = [info.name for info in infos]
    for name in names:
        if names.count(name) > 1:
            raise BagError(f"topic {name} is in two of the inputs")
    with _known_library(target):
        kind = TABLES.get(target.suffix.lower())
        if kind is not None:
            return _write_table(sources, infos, kind, target)
        messages = heapq.merge(*(source.messages() for source in sources),
                               key=lambda message: message.log_time_ns)
        if target.suffix.lower() == ".db3":
            return _write_output(target, lambda path: write_sqlite(path, infos, messages), infos)
        from ..bag import BagWriter
        with BagWriter(target) as writer:
            for info in infos:
                writer.copy_topic(info)
            for message in messages:
                writer.write(message.topic, message.data, message.log_time_ns,
                             message.publish_time_ns)
    return {info.name: info.count for info in infos}, {}


def _write_table(sources, infos, kind, target):
    from ..bag import cdr, read_bag, read_temperature
    topics, left_out = {}, {}
    for source in sources:
        for info in source.topics.values():
            if info.type_name in cdr.ACCELERATION_TYPES and info.count:
                samples = read_bag(source.path, [info.name])[info.name]
                topics[info.name] = _correlated(source, info, samples)
            elif info.type_name == cdr.TEMPERATURE and info.count:
                topics[info.name] = read_temperature(source.path, info.name)
            elif info.count:
                left_out[info.name] = info.count
    if not topics:
        raise BagError(f"{target}: the inputs hold no topic of acceleration or temperature")
    write = _function("write", kind)
    written, _ = _write_output(target, lambda path: write(path, topics), infos)
    return {name: written[name] for name in topics}, left_out


def _correlated(source, info, samples):
    """The samples with their whole covariance, where it is more than its diagonal."""
    from ..bag import cdr
    if info.type_name != cdr.IMU:
        return samples
    return Correlated.from_samples(samples, np.concatenate(
        [cdr.read_covariances(block.messages) for block in source.blocks([info.name])]))


def _write_output(target, write, infos):
    try:
        output = stage(target)
    except OSError as error:
        raise BagError(f"{target}: cannot be written: {error.strerror}") from None
    try:
        write(output.path)
        output.done()
    except UnicodeEncodeError:
        raise BagError(f"{target}: cannot be written: the library for this format takes only names "
                       "that are UTF-8") from None
    except (OSError, sqlite3.Error) as error:
        raise BagError(f"{target}: cannot be written: {getattr(error, 'strerror', '') or error}") \
            from None
    finally:
        if not output.is_complete:
            output.drop()
    return {info.name: info.count for info in infos}, {}


def _read_table(kind, path):
    try:
        return _function("read", kind)(path)
    except OSError as error:
        raise BagError(f"{path}: cannot be read: {error.strerror or error}") from None
    except ValueError as error:
        # pyarrow's errors are ValueErrors, and so are ours
        if isinstance(error, BagError):
            raise
        raise BagError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None


def _function(verb, kind):
    """Reader or writer of a kind of table; its library is loaded with it."""
    module = importlib.import_module(f".{_MODULES[kind]}", __package__)
    return getattr(module, f"{verb}_{kind}")


def _write_messages(target, topics, messages):
    from ..bag import BagWriter
    with BagWriter(target) as writer:
        for name, type_name, qos, type_hash in topics:
            writer.add_topic(name, type_name, qos, type_hash)
        for name, data, time_ns in messages:
            writer.write(name, data, time_ns)


def _single(path):
    """What rosbags knows the kind of: a folder without its metadata is read by its only file."""
    if path.is_dir() and not (path / "metadata.yaml").exists():
        files = sorted(path.glob("*.db3"))
        if len(files) != 1:
            raise BagError(f"{path}: has no metadata.yaml, and {len(files)} .db3 files: convert "
                           "them one by one")
        return files[0]
    if not path.is_dir() and path.suffix != ".db3":
        link = _folder() / f"{len(_made)}.db3"
        link.symlink_to(path.resolve())
        return link
    return path


def _folder():
    if "folder" not in _made:
        _made["folder"] = Path(tempfile.mkdtemp(prefix="frac_accel-"))
        atexit.register(shutil.rmtree, _made["folder"], ignore_errors=True)
    return _made["folder"]


@contextlib.contextmanager
def _known_library(path):
    try:
        yield
    except ModuleNotFoundError as error:
        raise BagError(f"{path}: needs the Python library {error.name}: {_HELP}") from None
