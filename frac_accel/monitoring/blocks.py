"""Residual of a running sensor in short blocks, as sums from which all else is computed.

What a change does to a sensor's output is some function of the motion. Whatever its cause, to
first order it shows in a few directions: the level, the output and its derivatives, its square and
its cube, the other axes; or in the size of the residual. Nothing here knows a cause.
"""

import dataclasses

import numpy as np

from ..diagnosis.problem import Problem
from ..errors import FracAccelError
from ..model import AXES
from ..record import Record

# Length of a block [s].
BLOCK_S = 0.25
# Samples that may be missing in a row and be bridged, and time [s] that the motion needs to settle
# after more.
_BRIDGED = 3
SETTLING_S = 1.5
# Residual power below this share of the output's is numerics.
_FLOOR = 1e-9

DIRECTIONS = ("level", "output", "its slope", "its curvature", "its square", "its cube",
              "one other axis", "the other axis")


@dataclasses.dataclass(frozen=True)
class Blocks:
    """Sums over consecutive blocks.

    Attributes
    ----------
    start_ns : ndarray of int64, shape (k,)
    count : ndarray, shape (k,)
        Samples that count.
    gram : ndarray, shape (k, p, p)
        Products of the directions among themselves; zero where one is not there.
    shared : ndarray, shape (k, p)
        Products of the directions with the residual.
    power : ndarray, shape (k,)
        Sum of the residual's squares.
    excitation : float
        Standard deviation of the reference's motion along the axis [m/s²].
    """

    start_ns: np.ndarray
    count: np.ndarray
    gram: np.ndarray
    shared: np.ndarray
    power: np.ndarray
    excitation: float

    @classmethod
    def joined(cls, parts):
        """One of several that follow each other."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts])
                     for field in dataclasses.fields(cls)[:-1]),
                   float(np.mean([part.excitation for part in parts])))

    def last(self, count):
        """So many of them."""
        return Blocks(*(getattr(self, field.name)[-count:]
                        for field in dataclasses.fields(self)[:-1]), self.excitation)

    def merged(self, every):
        """Sums over so many blocks at a time; what is left over at the end is dropped."""
        count = len(self.power) // every

        def sums(values):
            return values[:count * every].reshape(count, every, *values.shape[1:]).sum(axis=1)
        return Blocks(self.start_ns[:count * every:every],
                      *(sums(getattr(self, name)) for name in ("count", "gram", "shared", "power")),
                      self.excitation)


def blocks_of(reference, sensor, model, axis, keep_from_ns, epoch_ns):
    """Blocks of a stretch of a measured pair.

    Parameters
    ----------
    reference, sensor : Samples
    model : SensorModel
    axis : {"x", "y", "z"}
    keep_from_ns : int
        Blocks begin here; what lies before lets the motion settle.
    epoch_ns : int
        Stamp from which the model's drifts count.

    Returns
    -------
    blocks : Blocks
    rms : float
        Of the residual in the blocks [output units].

    Raises
    ------
    FracAccelError
        If the stretch is no pair.
    """
    column = AXES.index(axis)
    record = Record.of(reference, sensor, axis)
    record = dataclasses.replace(record, since_start_s=1e-9 * (record.start_ns - epoch_ns))
    problem = Problem(record, column, model, _settled(record))
    point = problem.point({}, False)
    if not np.isfinite(point.cost):
        raise FracAccelError("the model's motion has no bound")
    directions = _directions(point.simulated, record.reference, column, problem.rate, problem.used)
    used = problem.used & (np.arange(len(record)) / problem.rate * 1e9 + record.start_ns
                           >= keep_from_ns)
    size = max(round(BLOCK_S * problem.rate), 1)
    first = int(np.argmax(used)) if used.any() else len(used)
    last = len(used) - problem.edge
    count = max((last - first) // size, 0)
    rows = slice(first, first + count * size)
    residual, weight = point.residual[rows].reshape(count, size), used[rows].reshape(count, size)
    x = directions[rows].reshape(count, size, -1) * weight[:, :, None]
    blocks = Blocks(
        (record.start_ns + (first + size * np.arange(count)) * 1e9 / problem.rate).astype(np.int64),
        weight.sum(axis=1).astype(float), np.einsum("kni,knj->kij", x, x),
        np.einsum("kni,kn->ki", x, residual), np.sum((residual * weight)**2, axis=1)
        + _FLOOR * np.var(point.simulated) * weight.sum(axis=1),
        float(np.std(record.reference[problem.used, column])))
    total = max(blocks.count.sum(), 1.0)
    return blocks, float(np.sqrt(blocks.power.sum() / total))


def _settled(record):
    """Samples that are there and not too near after a gap, over which nobody knows the motion."""
    used = record.valid.copy()
    edges = np.flatnonzero(np.diff(np.r_[False, ~record.valid, False].astype(np.int8)))
    for first, last in zip(edges[::2], edges[1::2]):
        if last - first > _BRIDGED:
            used[first:last + round(SETTLING_S * record.sampling_rate_hz)] = False
    return used


def _directions(simulated, reference, column, rate, used):
    """Columns by which the residual is looked at, shape (n, 8)."""
    swing = simulated - simulated[used].mean()
    slope = np.gradient(swing) * rate
    others = [reference[:, i] - reference[:, i].mean() for i in range(3) if i != column]
    columns = [np.ones(len(swing)), swing, slope, np.gradient(slope) * rate, swing**2, swing**3,
               *others]
    return np.stack(columns, axis=1)
