"""Rows in Parquet, partitioned by date: written in parts that are whole or not there."""

import contextlib
import fcntl
import os
import time
import uuid

import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet

from ..errors import FracAccelError
from .places import file_system, is_local

# Longest time [s] and most rows for which rows are kept back to be written together.
_PATIENCE_S = 5.0
_TOGETHER = 500
_UNFINISHED = ".partial"

_FINDING = pa.struct([("cause", pa.string()), ("parameter", pa.string()), ("value", pa.float64()),
                      ("std", pa.float64()), ("unit", pa.string()),
                      ("reduction", pa.float64()), ("confidence", pa.float64())])
_BUDGET = pa.struct([("part", pa.string()), ("of", pa.string()), ("share", pa.float64()),
                     ("low", pa.float64()), ("high", pa.float64())])
_ESTIMATE = pa.struct([("cause", pa.string()), ("parameter", pa.string()), ("unit", pa.string()),
                       ("value", pa.float64()), ("std", pa.float64()), ("size", pa.float64())])
_COUNTER = pa.struct([("name", pa.string()), ("count", pa.int64())])

# What a row says; a column is null where its verb does not tell it.
COLUMNS = {
    **dict.fromkeys(("bag", "sha256", "job", "verb", "axis", "frame", "model", "model_sha256",
                     "error", "verdict", "reason", "cut_off", "structure", "output", "result",
                     "page", "changed", "frac_accel", "numpy", "scipy", "python", "worker"),
                    pa.string()),
    **dict.fromkeys(("start_ns", "size_bytes"), pa.int64()),
    **dict.fromkeys(("baseline_rmse", "baseline_nrmse", "noise_rms", "extended_rmse",
                     "extended_nrmse", "unexplained_fraction", "established_noise_rms",
                     "nrmse", "held_out_nrmse", "scaled_nrmse", "corrected_nrmse", "wall_s",
                     "cpu_s", "memory_mb"), pa.float64()),
    "causes": pa.list_(pa.string()), "notes": pa.list_(pa.string()),
    "parameters": pa.list_(_FINDING), "budget": pa.list_(_BUDGET),
    "estimates": pa.list_(_ESTIMATE), "correlations": pa.list_(pa.float32()),
    "counters": pa.list_(_COUNTER),
}


class Store:
    """Rows of one verb below a folder; a context manager that writes what is left.

    Parameters
    ----------
    results : str
        Folder, as fsspec takes it.
    verb : str
    given : list of str
        Names of further columns, of text.

    Attributes
    ----------
    given : list of str

    Raises
    ------
    FracAccelError
        If another run writes there, or rows with other columns are there already.
    """

    def __init__(self, results, verb, given=()):
        self.fs, root = file_system(results)
        self.root, self.folder = root, f"{root.rstrip('/')}/{verb}"
        self.given = list(given)
        self.schema = pa.schema([*COLUMNS.items(), *((name, pa.string()) for name in given)])
        self._waiting, self._last_s, self._lock = [], time.monotonic(), None

    def __enter__(self):
        self.fs.makedirs(self.folder, exist_ok=True)
        if is_local(self.fs):
            self._lock = open(f"{self.root}/.lock", "w")
            try:
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                self._lock.close()
                raise FracAccelError(f"{self.root}: another run writes there") from None
        for name in self.fs.find(self.folder):
            if name.endswith(_UNFINISHED):
                self.fs.rm(name)
        self._require_columns()
        return self

    def __exit__(self, kind, *_):
        try:
            # what is done is kept, whatever has ended the run
            with contextlib.suppress(OSError) if kind else contextlib.nullcontext():
                self.flush()
        finally:
            if self._lock is not None:
                self._lock.close()

    def _require_columns(self):
        known = self.parts()
        if not known:
            return
        with self.fs.open(known[0], "rb") as file:
            names = pa.parquet.read_schema(file).names
        others = [name for name in names if name not in COLUMNS]
        if others != self.given:
            raise FracAccelError(
                f"{self.folder}: has rows with the columns {', '.join(others) or 'of no table'}, "
                f"given are {', '.join(self.given) or 'none'}; use the same --columns, or "
                "another folder")

    def parts(self):
        """Files that hold rows."""
        if not self.fs.exists(self.folder):
            return []
        return sorted(name for name in self.fs.find(self.folder) if name.endswith(".parquet"))

    def read(self, columns=None):
        """Rows as a pyarrow Table."""
        parts = self.parts()
        if not parts:
            return self.schema.empty_table()
        return pa.dataset.dataset(parts, filesystem=self.fs, format="parquet",
                                  schema=self.schema).to_table(columns)

    def add(self, row, date):
        """Take a row; it is safe after `flush`, or by itself a few seconds later."""
        self._waiting.append((date, {name: row.get(name) for name in self.schema.names}))
        if len(self._waiting) >= _TOGETHER or time.monotonic() - self._last_s > _PATIENCE_S:
            self.flush()

    def flush(self):
        """Write the rows that wait.

        Raises
        ------
        FracAccelError
            If they cannot be written; those before stay.
        """
        by_date = {}
        for date, row in self._waiting:
            by_date.setdefault(date, []).append(row)
        for date, rows in by_date.items():
            try:
                self._write(f"{self.folder}/date={date}", rows)
            except OSError as error:
                self._waiting = []
                raise FracAccelError(f"{self.folder}: rows cannot be written: "
                                     f"{error.strerror or error}; what was written before stays, "
                                     "and the same command goes on from there") from None
            self._waiting = [entry for entry in self._waiting if entry[0] != date]
        self._last_s = time.monotonic()

    def _write(self, folder, rows):
        name = f"{folder}/part-{uuid.uuid4().hex}.parquet"
        table = pa.Table.from_pylist(rows, self.schema)
        self.fs.makedirs(folder, exist_ok=True)
        if not is_local(self.fs):
            with self.fs.open(name, "wb") as file:
                pa.parquet.write_table(table, file, compression="zstd")
            return
        unfinished = name + _UNFINISHED
        try:
            with open(unfinished, "wb") as file:
                pa.parquet.write_table(table, file, compression="zstd")
                file.flush()
                os.fsync(file.fileno())
            os.replace(unfinished, name)
        except BaseException:
            with contextlib.suppress(OSError):
                os.remove(unfinished)
            raise
