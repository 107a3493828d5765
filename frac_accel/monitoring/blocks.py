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
    centre : ndarray, shape (k, 3)
        What was taken from the output and from the other axes, before anything else was made of
        them.
    excitation : float
        Standard deviation of the reference's motion along the axis [m/s²].
    """

    start_ns: np.ndarray
    count: np.ndarray
    gram: np.ndarray
    shared: np.ndarray
    power: np.ndarray
    centre: np.ndarray
    excitation: float

    @classmethod
    def joined(cls, parts):
        """One of several that follow each other."""
        return cls(*(np.concatenate([getattr(part, field.name) for part in parts])
                     for field in dataclasses.fields(cls)[:-1]),
                   float(np.mean([part.excitation for part in parts])))

    def part(self, rows):
        """Those of a slice, or of a mask."""
        return Blocks(*(getattr(self, field.name)[rows]
                        for field in dataclasses.fields(self)[:-1]), self.excitation)

    def merged(self, every):
        """Sums over so many blocks at a time; what is left over at the end is dropped."""
        count = len(self.power) // every

        def together(values):
            return values[:count * every].reshape(count, every, *values.shape[1:])
        return Blocks(self.start_ns[:count * every:every],
                      *(together(getattr(self, name)).sum(axis=1)
                        for name in ("count", "gram", "shared", "power")),
                      together(self.centre).mean(axis=1), self.excitation)

    def about_one_centre(self):
        """The same sums, of directions that all have the centre of the last block.

        About the mean of its own window, a gain shows along the level, too, by another amount in
        each; a square along the output.
        """
        away = self.centre - self.centre[-1]
        turn = np.tile(np.eye(self.shared.shape[1]), (len(away), 1, 1))
        output = away[:, 0]
        turn[:, 1, 0], turn[:, 6, 0], turn[:, 7, 0] = away.T
        turn[:, 4, 0], turn[:, 4, 1] = output**2, 2 * output
        turn[:, 5, 0], turn[:, 5, 1], turn[:, 5, 4] = output**3, 3 * output**2, 3 * output
        return dataclasses.replace(
            self, gram=turn @ self.gram @ turn.transpose(0, 2, 1), centre=self.centre - away,
            shared=np.einsum("kij,kj->ki", turn, self.shared))


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
    others = np.delete(record.reference, column, axis=1)
    centre = np.r_[point.simulated[problem.used].mean(), others.mean(axis=0)]
    directions = _directions(point.simulated - centre[0], others - centre[1:], problem.rate)
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
        + _FLOOR * np.var(point.simulated) * weight.sum(axis=1), np.tile(centre, (count, 1)),
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


def _directions(swing, others, rate):
    """Columns by which the residual is looked at, shape (n, 8)."""
    slope = np.gradient(swing) * rate
    columns = [np.ones(len(swing)), swing, slope, np.gradient(slope) * rate, swing**2, swing**3,
               *others.T]
    return np.stack(columns, axis=1)
