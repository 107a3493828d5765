"""Bags and results on disks and in object stores, by fsspec (loaded when it is needed)."""

import contextlib
import os
import tempfile
from pathlib import Path
from typing import NamedTuple

from ..errors import FracAccelError

_METADATA = "metadata.yaml"


class Bag(NamedTuple):
    """A bag as it lies in its store.

    Attributes
    ----------
    url : str
        What opens it again.
    size : int
        Bytes of all its files.
    changed : str
        Time of the last change, or whatever the store has for it.
    """

    url: str
    size: int
    changed: str


def find_bags(patterns):
    """Bags that patterns name, each once, in the order of their names.

    A pattern is a bag, a folder of bags at any depth, or either with ``*``; a folder with a
    ``metadata.yaml`` is one bag.

    Parameters
    ----------
    patterns : list of str

    Returns
    -------
    list of Bag

    Raises
    ------
    FracAccelError
        If a pattern matches nothing, or its store cannot be reached.
    """
    found = {}
    for pattern in patterns:
        try:
            fs, path = file_system(pattern)
            before = len(found)
            for place in _expanded(fs, path):
                for bag in _bags_at(fs, place):
                    found[bag.url] = bag
        except (OSError, ValueError, ImportError) as error:
            raise FracAccelError(f"{pattern}: cannot be read: {error}") from None
        if len(found) == before and not any(url.startswith(path) for url in found):
            raise FracAccelError(f"{pattern}: no bag matches, expected .mcap files or rosbag2 "
                                 "folders")
    return [found[url] for url in sorted(found)]


def _expanded(fs, path):
    if any(sign in path for sign in "*?["):
        return sorted(fs.glob(path))
    return [path] if fs.exists(path) else []


def _bags_at(fs, path):
    if not fs.isdir(path):
        if path.endswith(".mcap"):
            yield _bag(fs, path, [fs.info(path)])
        return
    files = fs.find(path, detail=True)
    folders = {os.path.dirname(name) for name in files if os.path.basename(name) == _METADATA}
    for folder in sorted(folders):
        yield _bag(fs, folder, [info for name, info in files.items()
                                if os.path.dirname(name) == folder and name.endswith(".mcap")])
    for name, info in files.items():
        if name.endswith(".mcap") and os.path.dirname(name) not in folders:
            yield _bag(fs, name, [info])


def _bag(fs, path, infos):
    changed = max((str(info.get("mtime") or info.get("LastModified") or info.get("ETag")
                       or info.get("created") or "") for info in infos), default="")
    url = path if is_local(fs) else fs.unstrip_protocol(path)
    return Bag(url, sum(info["size"] or 0 for info in infos), changed)


def is_local(fs):
    """Whether a file system is this machine's."""
    from fsspec.implementations.local import LocalFileSystem
    return isinstance(fs, LocalFileSystem)


def file_system(url):
    """File system of a URL, and the path there."""
    from fsspec.core import url_to_fs
    return url_to_fs(url)


@contextlib.contextmanager
def at_hand(url):
    """Path of a bag on a local disk; a copy for as long as this is entered where it is elsewhere.
    """
    fs, path = file_system(url)
    if is_local(fs):
        yield Path(path)
        return
    with tempfile.TemporaryDirectory(prefix="frac_accel-bag-") as folder:
        copy = Path(folder) / os.path.basename(path.rstrip("/"))
        fs.get(path, str(copy), recursive=fs.isdir(path))
        yield copy


@contextlib.contextmanager
def output_at(url):
    """Path to write a file to that then is at a place, complete or not at all.

    What is written to a local disk must itself be put there in one piece.
    """
    fs, path = file_system(url)
    if is_local(fs):
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="frac_accel-output-") as folder:
        copy = os.path.join(folder, os.path.basename(path))
        yield copy
        if os.path.exists(copy):
            fs.put_file(copy, path)
