"""Columns of a table, and the topics that they are: by their names, or as the user maps them.

A column is named ``x [m/s^2]``, or ``/imu/reference/x [m/s^2]`` where a table holds several
topics; the unit may also come from the file itself. A topic has a stamp and any of x, y, z, with
``variance_x`` and so on beside them, or a stamp and a temperature. What is written has exactly
these names, so that stamps, values and variances come back as they were.
"""

import dataclasses
import os
import re
from typing import NamedTuple

import numpy as np

from ...errors import BagError, FracAccelError
from ..bag.mcap_file import allowed_bytes
from ..cdr import Temperatures
from ..samples import Correlated, Samples
from .units import acceleration_factor, celsius_offset, time_factor_ns

_AXES = "xyz"
# Places in a covariance row by row, beside its diagonal: the second three repeat the first.
_ACROSS = {"xy": 1, "xz": 2, "yz": 5, "yx": 3, "zx": 6, "zy": 7}
_UNSUSPECTED_BYTES = 256 * 2**20
_UNIT = re.compile(r"^(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]]*)[\])]\s*$")
_SUFFIX = re.compile(r"^(?P<name>.+)_(?P<unit>ns|us|ms|s)$")
# "x", "/imu/data_raw/x", and as PlotJuggler exports it "/imu/data_raw/linear_acceleration/x".
_FIELD = re.compile(r"^(?:(?P<topic>/.*?)[/.])?(?:linear_acceleration[/.])?"
                    r"(?P<field>[xyz]|temperature)$")
_TIMES = ("stamp", "time", "timestamp", "timestamps", "t", "seconds", "seconds_elapsed", "__time")
_TEMPERATURE = "/imu/temperature"
_SECONDS = ("seconds", "seconds_elapsed", "__time")


class Column(NamedTuple):
    """Values (n,) of a column, and its unit ("" where none is stated).

    ``is_double`` where a table has two of that name: nobody can say which is meant.
    """

    values: np.ndarray
    unit: str
    is_double: bool = False


def split_unit(name):
    """Name and unit ("" without) of a column: ``x [g]``, ``x (g)``, ``time_ns``."""
    found = _UNIT.match(name) or _SUFFIX.match(name)
    return (found["name"], found["unit"]) if found else (name, "")


class Group(NamedTuple):
    """Columns by name, of one topic or ("") of any."""

    topic: str
    columns: dict

    @classmethod
    def of(cls, named):
        """Group of any topics from (name, values, unit); names may state the unit."""
        columns = {}
        for name, values, unit in named:
            name, own = split_unit(name)
            columns[name] = Column(np.asarray(values), unit or own, name in columns)
        return cls("", columns)

    def split(self):
        """A group for each value of the column ``topic``, if there is one."""
        if "topic" not in self.columns:
            return [self]
        topics = np.array([str(topic) for topic in self.columns["topic"].values.tolist()])
        groups = []
        for topic in dict.fromkeys(topics.tolist()):
            rows = topics == topic
            columns = {name: column._replace(values=column.values[rows])
                       for name, column in self.columns.items() if name != "topic"}
            groups.append(Group(topic, {name: column for name, column in columns.items()
                                        if not _is_empty(column.values)}))
        return groups


@dataclasses.dataclass(frozen=True)
class Wishes:
    """What the user says of a table.

    Attributes
    ----------
    axes : dict of str to tuple of str
        Topic to the names of its columns x, y, z; "-" or none where there is none.
    units : dict of str to str
        Topic ("" for all) to the unit of its columns.
    time, time_unit : str
        Name and unit of the column of time.
    rate_hz : float
        Sampling rate of a table without one.
    topic : str
        Of columns that name none.
    """

    axes: dict = dataclasses.field(default_factory=dict)
    units: dict = dataclasses.field(default_factory=dict)
    time: str = ""
    time_unit: str = ""
    rate_hz: float = 0.0
    topic: str = "/imu/data_raw"


def require_plausible_size(path, unpacked):
    """Refuse a table that unpacks to far more than it has on the disk, before memory is taken.

    Raises
    ------
    BagError
    """
    size = os.stat(path).st_size
    if unpacked > allowed_bytes(size, 2**62, _UNSUSPECTED_BYTES):
        raise BagError(f"{path}: unpacks to {unpacked} bytes, more than {size} on the disk can be")


def topics_of(groups, wishes, where):
    """`Samples` or `Temperatures` of a table's groups, by topic.

    Raises
    ------
    BagError
        If no topic is found, or a column, a time or a unit is missing; says how to name it.
    """
    found = {}
    groups = [part for group in groups for part in group.split()]
    try:
        for group in groups:
            for topic, fields in _fields(group, wishes).items():
                if topic in found:
                    raise FracAccelError(f"topic {topic} is there twice")
                found[topic] = _content(group, topic, fields, wishes)
    except FracAccelError as error:
        raise BagError(f"{where}: {error}") from None
    missing = [topic for topic in wishes.axes if topic not in found]
    if missing or not found:
        raise BagError(f"{where}: {_unrecognised(groups, wishes, missing)}")
    if not any(len(content.stamps_ns) for content in found.values()):
        raise BagError(f"{where}: has no rows with values for {', '.join(found)}")
    return found


def _fields(group, wishes):
    """{topic: {"x", "y", "z" or "temperature": name of the column}} of a group."""
    if wishes.axes:
        return {topic: {axis: name for axis, name in zip(_AXES, names) if name != "-"}
                for topic, names in wishes.axes.items()
                if all(name == "-" or name in group.columns for name in names)}
    topics = {}
    for name in group.columns:
        match = _FIELD.match(name)
        if match:
            topic = match["topic"] or group.topic or (
                _TEMPERATURE if match["field"] == "temperature" else wishes.topic)
            topics.setdefault(topic, {})[match["field"]] = name
    return topics


def _content(group, topic, fields, wishes):
    columns = {field: _the(group, name) for field, name in fields.items()}
    if len({len(column.values) for column in columns.values()}) > 1:
        raise FracAccelError(f"columns {', '.join(fields.values())} are not as long")
    empty = np.all([_is_missing(column.values) for column in columns.values()], axis=0)
    stamps = _stamps(group, topic, wishes, len(empty))
    if len(stamps) != len(empty):
        raise FracAccelError(f"topic {topic} has {len(empty)} values and {len(stamps)} stamps")
    stamps = stamps[~empty]
    frame = _beside(group, topic, "frame_id")
    frame = str(frame.values[0]) if frame is not None and len(frame.values) else "accel_link"
    unit = wishes.units.get(topic, wishes.units.get("", ""))
    if "temperature" in columns:
        column = columns["temperature"]
        offset = celsius_offset(column.unit or "degC", f"column '{fields['temperature']}'")
        variance = _beside(group, topic, "variance")
        return Temperatures(stamps, _numbers(column, fields["temperature"])[~empty] + offset,
                            np.full(len(stamps), np.nan) if variance is None
                            else _numbers(variance, "variance")[~empty], frame)
    values = np.zeros((len(stamps), 3))
    variances = np.full((len(stamps), 3), np.nan)
    for axis, column in columns.items():
        place, where = _AXES.index(axis), f"column '{fields[axis]}'"
        if not (unit or column.unit):
            raise FracAccelError(f"{where} states no unit: name it such as "
                                 f"'{fields[axis]} [m/s^2]', or convert it with --unit")
        factor = acceleration_factor(unit or column.unit, where)
        values[:, place] = factor * _numbers(column, fields[axis])[~empty]
        variance = _beside(group, topic, f"variance_{axis}")
        if variance is not None:
            variances[:, place] = factor**2 * _numbers(variance, f"variance_{axis}")[~empty]
    samples = Samples(stamps, values, variances, frame)
    return Correlated.from_samples(samples, _covariance(group, topic, samples, ~empty, factor))


def _covariance(group, topic, samples, rows, factor):
    """Covariance (n, 9) of a topic's samples; what the table does not say is 0."""
    result = np.zeros((len(samples.values), 9))
    result[:, ::4] = np.nan_to_num(samples.variance)
    for name, place in _ACROSS.items():
        column = _beside(group, topic, f"covariance_{name}")
        if column is not None:
            result[:, place] = factor**2 * np.nan_to_num(_numbers(column, name)[rows])
        elif place in (3, 6, 7):
            result[:, place] = result[:, _ACROSS[name[::-1]]]
    return result


def _stamps(group, topic, wishes, count):
    """Stamps [ns] of a topic's rows."""
    if wishes.rate_hz:
        return np.round(np.arange(count) * (1e9 / wishes.rate_hz)).astype(np.int64)
    name, column = _time(group, topic, wishes)
    values = column.values
    if values.dtype.kind == "M":
        return values.astype("datetime64[ns]").astype(np.int64)
    unit = wishes.time_unit or column.unit or ("s" if name.lower() in _SECONDS else "")
    if not unit:
        raise FracAccelError(f"column '{name}' states no unit: name it such as '{name} [s]', or "
                             "convert it with --time-unit")
    factor = time_factor_ns(unit, f"column '{name}'")
    if values.dtype.kind in "iu":
        return values.astype(np.int64) * factor
    seconds = _numbers(column, name)
    if not np.isfinite(seconds).all():
        row = int(np.flatnonzero(~np.isfinite(seconds))[0])
        raise FracAccelError(f"column '{name}' has no time in row {row}")
    if np.abs(seconds).max(initial=0.0) > 2.0**62 / factor:
        raise FracAccelError(f"column '{name}' has times that no stamp can hold: is its unit "
                             f"{unit}?")
    whole = np.floor(seconds)
    return whole.astype(np.int64) * factor + np.round((seconds - whole) * factor).astype(np.int64)


def _time(group, topic, wishes):
    if wishes.time:
        if wishes.time not in group.columns:
            raise FracAccelError(f"has no column '{wishes.time}', but {_names(group)}")
        return wishes.time, _the(group, wishes.time)
    own = {name.lower(): name for name in group.columns}
    for name in (f"{topic}/stamp".lower(), *_TIMES):
        if name in own:
            return own[name], _the(group, own[name])
    raise FracAccelError(f"has no column of time among {_names(group)}: convert it with --time "
                         "COLUMN, or with --rate HZ where there is none")


def _the(group, name):
    """The only column of that name."""
    if group.columns[name].is_double:
        raise FracAccelError(f"two columns are named '{name}': rename one")
    return group.columns[name]


def _beside(group, topic, field):
    """Column of a topic's further field, or None."""
    return group.columns.get(f"{topic}/{field}", group.columns.get(field))


def _numbers(column, name):
    try:
        if column.values.dtype.kind != "c":
            return column.values.astype(float)
    except (TypeError, ValueError):
        pass
    odd = next(value for value in column.values.tolist() if not is_number(value))
    raise FracAccelError(f"column '{name}' holds {odd!r}, expected numbers")


def is_number(value):
    """Whether a cell holds a number, or text that is one."""
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def _is_missing(values):
    return np.isnan(values) if values.dtype.kind == "f" else np.zeros(len(values), bool)


def _is_empty(values):
    return values.dtype.kind == "f" and bool(np.isnan(values).all())


def _names(group):
    return ", ".join(f"'{name}'" for name in group.columns) or "none"


def _unrecognised(groups, wishes, missing):
    there = "; ".join(map(_names, groups)) or "none"
    if missing:
        topic = missing[0]
        wanted = [name for name in wishes.axes[topic] if name != "-"]
        absent = [name for name in wanted if not any(name in group.columns for group in groups)]
        if absent:
            return f"has no column {', '.join(map(repr, absent))} for {topic}, but {there}"
        return f"has the columns {', '.join(wanted)} for {topic} not in one group, but {there}"
    return (f"no column is named as a topic's (/imu/reference/x [m/s^2] and so on), but {there}: "
            "say which is which, such as frac_accel convert FILE -o OUT.mcap "
            "--map /imu/reference=COLUMN --map /imu/data_raw=COLUMN --unit g")


def columns_of(content):
    """Columns [(name with unit, values)] of `Samples` or `Temperatures`, without the frame."""
    stamps = np.asarray(content.stamps_ns, np.int64)
    if isinstance(content, Temperatures):
        pairs = [("temperature [degC]", content.celsius), ("variance [degC^2]", content.variance)]
    else:
        pairs = [(f"{axis} [m/s^2]", content.values[:, i]) for i, axis in enumerate(_AXES)]
        pairs += [(f"variance_{axis} [(m/s^2)^2]", content.variance[:, i])
                  for i, axis in enumerate(_AXES)]
        if isinstance(content, Correlated):
            pairs += _across(content.covariance)
    return [("stamp [ns]", stamps), *((name, values) for name, values in pairs
                                      if not _is_empty(np.asarray(values)))]


def _across(covariance):
    """Columns of what is beside the diagonal: three, or six where it is not symmetric."""
    upper, lower = list(_ACROSS.values())[:3], list(_ACROSS.values())[3:]
    names = list(_ACROSS)
    if np.array_equal(covariance[:, upper], covariance[:, lower]):
        names = names[:3]
    return [(f"covariance_{name} [(m/s^2)^2]", covariance[:, _ACROSS[name]]) for name in names]
