"""Which bags are to be done, with what, and what of it is done already."""

import csv
import dataclasses
import datetime
import hashlib
import os

from ..errors import FracAccelError
from ..io.regular_file import read_text
from ..model import SensorModel
from .workers import package_version

# Bytes of a table of bags, and of a model.
_LARGEST_TABLE = 256 * 2**20
_LARGEST_MODEL = 2**20
# Columns of a table that are no groups of vehicles.
OF_BAGS = ("bag", "model")
VEHICLE = "vehicle"


class Table:
    """What somebody knows of the bags.

    Parameters
    ----------
    path : str or None
        CSV with a column ``bag`` (a name or a path) and any others; None: nothing is known.
    bags : list of Bag

    Attributes
    ----------
    names : list of str
        Of the columns, without ``bag`` and ``model``.

    Raises
    ------
    FracAccelError
        If it cannot be read, has no such column, or tells of none of the bags.
    """

    def __init__(self, path, bags):
        self.names, self._rows = [], {}
        if path is None:
            return
        try:
            lines = list(csv.reader(read_text(path, _LARGEST_TABLE).splitlines()))
        except (OSError, ValueError, csv.Error) as error:
            raise FracAccelError(f"{path}: cannot be read: {error}") from None
        head = [name.strip() for name in lines[0]] if lines else []
        if "bag" not in head or len(set(head)) < len(head):
            raise FracAccelError(f"{path}: its first line has the columns {', '.join(head) or '-'},"
                                 " expected one named bag, and each name once")
        for number, line in enumerate(lines[1:], 2):
            if len(line) != len(head):
                raise FracAccelError(f"{path}: line {number} has {len(line)} columns, expected "
                                     f"{len(head)}")
            entry = dict(zip(head, map(str.strip, line)))
            self._rows[entry["bag"]] = entry
        self.names = [name for name in head if name not in OF_BAGS]
        if not any(self.of(bag.url) for bag in bags):
            raise FracAccelError(f"{path}: tells of none of the bags, expected their names or "
                                 "paths in the column bag")

    def of(self, url):
        """Entry of a bag, by column; empty where nothing is known."""
        return self._rows.get(url) or self._rows.get(os.path.basename(url.rstrip("/"))) or {}


class Models:
    """Sensor models by bag, as text: workers elsewhere have not their files.

    Parameters
    ----------
    path : str or None
        Of the model of all bags.
    table : Table

    Raises
    ------
    FracAccelError
        If a model cannot be used.
    """

    def __init__(self, path, table):
        self._common, self._table, self._read = path, table, {}
        self.of("")

    def of(self, url):
        """(file, SHA-256, text) for a bag; empty where it has none."""
        path = self._table.of(url).get("model") or self._common
        if not path:
            return "", "", ""
        if path not in self._read:
            _, model_hash = SensorModel.load_with_hash(path)
            self._read[path] = path, model_hash, read_text(path, _LARGEST_MODEL)
        return self._read[path]


@dataclasses.dataclass(frozen=True)
class Plan:
    """From bags to tasks, those left out that are done.

    Attributes
    ----------
    verb : str
    arguments : list of str
        The verb's options, without bag, axis, model and outputs.
    axes : list of str
        ``[""]`` where the verb has none.
    results : str
    pages : bool
    table : Table
    models : Models
    done : set of tuple
        (content, axis, job) of the rows that are there.
    """

    verb: str
    arguments: list
    axes: list
    results: str
    pages: bool
    table: Table
    models: Models
    done: set

    def job(self, model_hash):
        """What makes two rows of one bag the same work."""
        parts = [self.verb, *self.arguments, model_hash, package_version()]
        return hashlib.sha256("\0".join(parts).encode()).hexdigest()[:16]

    def tasks(self, inspected):
        """A task for each bag and axis that has no row yet, by date; each content once.

        Parameters
        ----------
        inspected : list of dict
            Of `inspect`, with ``size_bytes`` and ``changed``.
        """
        self._require_one_sensor(inspected)
        done, tasks = set(self.done), []
        for seen in sorted(inspected, key=lambda entry: (entry["date"], entry["bag"])):
            model, model_hash, text = self.models.of(seen["bag"])
            job = self.job(model_hash)
            for axis in self.axes:
                key = seen["sha256"] or seen["bag"], axis, job
                if key in done:
                    continue
                done.add(key)
                tasks.append(self._task(seen, axis, job, model, model_hash, text))
        return tasks

    def _task(self, seen, axis, job, model, model_hash, text):
        stem = os.path.basename(seen["bag"].rstrip("/")).removesuffix(".mcap")
        known = self.table.of(seen["bag"])
        given = {name: known.get(name, "") for name in self.table.names}
        return {
            "verb": self.verb, "bag": seen["bag"], "axis": axis, "arguments": self.arguments,
            "results": self.results, "pages": self.pages, "model": os.path.basename(model),
            "model_text": text, "date": seen["date"], "error": seen["error"],
            "name": "-".join(filter(None, [stem, (seen["sha256"] or "unread")[:12], axis])),
            "carried": {**given, **{key: seen[key] for key in (
                "sha256", "start_ns", "frame", "size_bytes", "changed")},
                "job": job, "model": model, "model_sha256": model_hash}}

    def _require_one_sensor(self, inspected):
        """Refuse one model for bags of several sensors."""
        frames = {}
        for seen in inspected:
            if not seen["error"] and "model" not in self.table.of(seen["bag"]) \
                    and self.models.of(seen["bag"])[0]:
                frames.setdefault(seen["frame"], []).append(seen["bag"])
        if len(frames) > 1:
            counts = ", ".join(f"{frame or 'without a frame'} ({len(bags)}, such as "
                               f"{os.path.basename(bags[0])})" for frame, bags in frames.items())
            raise FracAccelError(f"one model is given for bags of several sensors: {counts}; name "
                                 "the bags of one, or each bag's model in a column model of "
                                 "--columns")


def known_bags(rows):
    """Inspections of bags that have rows, by (URL, size, change)."""
    found = {}
    for row in rows:
        if row["sha256"]:
            start = row["start_ns"]
            date = "unknown" if start is None else str(datetime.datetime.fromtimestamp(
                start * 1e-9, datetime.timezone.utc).date())
            found[row["bag"], row["size_bytes"], row["changed"]] = {
                "bag": row["bag"], "sha256": row["sha256"], "date": date, "start_ns": start,
                "frame": row["frame"] or "", "error": row["error"] if start is None else ""}
    return found
