"""Arrays of numpy: ``.npz`` with an array for each column, ``.npy`` with rows or named fields."""

import zipfile
import zlib

import numpy as np

from ...errors import BagError
from .columns import Group, columns_of, require_plausible_size, split_unit

# What zipfile and numpy raise for damaged archives, foreign ones and encrypted ones.
_UNREADABLE = (ValueError, OSError, EOFError, RuntimeError, NotImplementedError, zipfile.BadZipFile,
               zlib.error)


def read_npz(path):
    """Group of an archive; topics may be of different lengths."""
    archive = _load(path)
    with archive:
        require_plausible_size(path, sum(entry.file_size for entry in archive.zip.infolist()))
        try:
            arrays = {name: archive[name] for name in archive.files}
        except _UNREADABLE as error:
            raise _unreadable(path, error) from None
    return [Group.of([column for name, array in arrays.items()
                      for column in _columns(path, name, array)])]


def read_npy(path):
    """Group of one array: named fields, or one to three columns x, y, z."""
    array = _load(path)
    if array.dtype.names:
        return [Group.of([(name, array[name], "") for name in array.dtype.names])]
    return [Group.of(_columns(path, "", array))]


def write_npz(path, topics):
    """Write topics: ``/imu/data_raw/stamp [ns]`` and so on."""
    arrays = {}
    for topic, content in topics.items():
        arrays[f"{topic}/frame_id"] = np.array([content.frame_id])
        arrays.update({f"{topic}/{name}": np.asarray(values)
                       for name, values in columns_of(content)})
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


def _load(path):
    try:
        return np.load(path, allow_pickle=False)
    except _UNREADABLE as error:
        raise _unreadable(path, error) from None


def _unreadable(path, error):
    words = " ".join(str(error).split())
    if "pickle" in words:
        # numpy's words advise to read what may run any code
        words = "it is no file of numpy's, or holds Python objects, which are never read"
    return BagError(f"{path}: cannot be read: {words}")


def _columns(path, name, array):
    """(name, values, unit) of an array; of one with several columns, x, y and z below its name."""
    if array.ndim == 1:
        return [(name or "x", array, "")]
    if array.ndim != 2 or not 1 <= array.shape[1] <= 3:
        of = f"array '{name}'" if name else "its array"
        raise BagError(f"{path}: {of} has shape {array.shape}, expected (n,) or (n, 3)")
    name, unit = split_unit(name)
    return [(f"{name}/{axis}" if name else axis, array[:, i], unit)
            for i, axis in zip(range(array.shape[1]), "xyz")]
