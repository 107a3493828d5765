"""A very long record by some stretches of it, so that memory and time do not grow with it."""

import dataclasses

import numpy as np

from ..identification.response.excitation import strongest_stretch
from .other_axes import UNLIKE
from .problem import Problem
from .short_columns import ShortColumns

# Samples from which on a record is seen by stretches, of each stretch, and how many there are.
MOST = 120_000
_LENGTH = 20_000
_COUNT = 4
# Samples of the neighbouring stretches that are simulated with what lies between them.
_OVERLAP = 500


def stretches_of(record, axis):
    """Slices of a record: where the motion is strongest, and others spread from start to end.

    One that holds all of a record that is not very long.
    """
    if len(record) <= MOST:
        return [slice(0, len(record))]
    strongest = strongest_stretch(record.reference[:, axis], _LENGTH)
    others = [slice(start, start + _LENGTH) for start in
              np.linspace(0, len(record) - _LENGTH, _COUNT).astype(int)]
    apart = [rows for rows in others
             if rows.stop <= strongest.start or strongest.stop <= rows.start]
    return sorted([strongest, *apart], key=lambda rows: rows.start)


def strongest_part(record, axis, used, length):
    """Where the motion is strongest, at most `length` samples of a record; and those `used` there.
    """
    rows = strongest_stretch(record.reference[:, axis], length)
    return record.part(rows), used[rows]


class Stretches(Problem):
    """A `Problem` of which some stretches are simulated, each as a record of its own.

    All arrays are those of the stretches, one after the other; `time` has jumps.

    Parameters
    ----------
    record, axis, baseline, used, limit
        As for `Problem`, of the whole record.
    slices : list of slice
    others : OtherAxes
        As for `Problem`.
    """

    def __init__(self, record, axis, baseline, used, limit, slices, others=UNLIKE):
        self.slices, self._whole, self._dated = slices, (record, used), {}
        self.parts = []
        super().__init__(_joined(record, slices), axis, baseline, self.taken(used), limit,
                         others)
        self.parts = [Problem(record.part(rows), axis, baseline, used[rows], self.limit,
                              others) for rows in slices]
        self.time = np.concatenate([rows.start / self.rate + part.time
                                    for rows, part in zip(slices, self.parts)])
        self.used = np.concatenate([part.used for part in self.parts])

    def taken(self, values):
        """Values of the whole record, shape (n, ...), where the stretches are."""
        return np.concatenate([values[rows] for rows in self.slices])

    def put_back(self, values, whole):
        """The whole record's values with those of the stretches replaced."""
        whole = whole.copy()
        for rows, part in zip(self.slices, self._split(values)):
            whole[rows] = part
        return whole

    def strongest(self, length):
        """Slice of at most `length` samples within one stretch, where the motion is strongest."""
        reference = self.record.reference[:, self.axis]
        found, start = [], 0
        for part in self._split(reference):
            rows = strongest_stretch(part, length)
            found.append((float(np.var(part[rows])),
                          slice(start + rows.start, start + rows.stop)))
            start += len(part)
        return max(found, key=lambda entry: entry[0])[1]

    @property
    def coherent(self):
        """Slice without gaps in time: the stretch with the strongest motion."""
        return self.strongest(_LENGTH)

    def part(self, rows):
        """Record of a slice within one stretch."""
        start = 0
        for stretch in self.parts:
            if rows.stop <= start + len(stretch.record):
                return stretch.record.part(slice(rows.start - start, rows.stop - start))
            start += len(stretch.record)
        raise ValueError(f"{rows} ends behind the last stretch")

    def _split(self, values):
        return np.split(values, np.cumsum([rows.stop - rows.start for rows in self.slices])[:-1])

    def simulate(self, effects, across=True, steps=None):
        """As `Problem.simulate`, stretch by stretch."""
        more = {} if steps is None else {"steps": steps}
        return np.concatenate([part.simulate(effects, across, **more) for part in self.parts])

    def change(self, effects, cause, effect, by_links=True):
        """As `Problem.change`, stretch by stretch."""
        return np.concatenate([part.change(effects, cause, effect, by_links)
                               for part in self.parts])

    def let_go(self):
        """As `Problem.let_go`."""
        super().let_go()
        for part in self.parts:
            part.let_go()

    def _free_columns(self, model):
        # what was before each stretch has left its own
        return ShortColumns.in_turn([part._free_columns(model) for part in self.parts])

    def own_motions(self, effect):
        """As `Problem.own_motions`, with columns of its own for each stretch."""
        return ShortColumns.in_turn([part.own_motions(effect) for part in self.parts])

    def response(self, axis, links=()):
        """As `Problem.response`, stretch by stretch."""
        return np.concatenate([part.response(axis, links) for part in self.parts])

    def errors(self, fitted):
        """As `Problem.errors`, of the whole record, with what no fit has seen."""
        record, used = self._whole
        found = np.full(len(record), np.nan)
        for start in range(0, len(record), _LENGTH):
            # what would be short belongs to the one before
            is_last = len(record) - start < 2 * _LENGTH
            rows = slice(start, len(record) if is_last else start + _LENGTH)
            part = Problem(record.part(rows), self.axis, self.baseline, used[rows], self.limit,
                           self.others)
            if part.used.any():
                found[rows] = part.errors(part.fit(fitted.effects, iterations=0))
            if rows.stop == len(record):
                return found

    def dated(self, fit):
        """Effects of a fit, with instants that lie between two stretches found there.

        The instant is that at which least squares change from the model before it to the one after
        it: D. V. Hinkley, *Biometrika* 57 (1970) 1-17.
        """
        effects = dict(fit.effects)
        for unknown in fit.unknowns:
            at_s = getattr(effects[unknown.cause], unknown.name)
            rows = self._around(at_s) if unknown.jumps else None
            if rows is None:
                continue
            part = Problem(self._whole[0].part(rows), self.axis, self.baseline,
                           self._whole[1][rows], self.limit)
            begins_s = part.record.since_start_s
            ends_s = begins_s + len(part.record) / self.rate
            before, after = (part.point({**effects, unknown.cause: dataclasses.replace(
                effects[unknown.cause], **{unknown.name: instant})}, False).residual**2
                for instant in (ends_s, begins_s))
            # with the change before each sample
            cost = np.cumsum(before - after) - (before - after)
            near = np.flatnonzero(cost < cost.min() + 4 * fit.cost / self.count)
            at_s = begins_s + (np.argmin(cost) - 0.5) / self.rate
            effects[unknown.cause] = dataclasses.replace(
                effects[unknown.cause], **{unknown.name: max(float(at_s), 0.0)})
            self._dated[unknown.cause, unknown.name] = \
                at_s, max((near[-1] - near[0]) / 4, 1 / np.sqrt(12)) / self.rate
        return effects

    def _around(self, at_s):
        """Slice from one stretch into the next where an instant lies between them, or None."""
        place = (at_s - self._whole[0].since_start_s) * self.rate
        for one, other in zip(self.slices, self.slices[1:]):
            if one.stop - 2 * self.edge < place < other.start + 2 * self.edge:
                return slice(one.stop - _OVERLAP, other.start + _OVERLAP)
        return None

    def jump_std(self, fit, unknown, peak):
        """As `Problem.jump_std`; of an instant between two stretches, as `dated` has found it."""
        at_s, std_s = self._dated.get((unknown.cause, unknown.name), (np.inf, np.inf))
        if abs(getattr(fit.effects[unknown.cause], unknown.name) - at_s) < 1 / self.rate:
            return float(np.sqrt(peak) * std_s)
        return super().jump_std(fit, unknown, peak)

    def restricted(self, used):
        """As `Problem.restricted`."""
        fewer = super().restricted(used)
        fewer.parts = [part.restricted(rows) for part, rows in zip(self.parts, self._split(used))]
        return fewer

    def beside(self, others):
        """As `Problem.beside`."""
        other = super().beside(others)
        other.parts = [part.beside(others) for part in self.parts]
        return other

    def mirrored(self):
        """As `Problem.mirrored`."""
        turned = super().restricted(self.used)
        turned.parts = [part.mirrored() for part in self.parts]
        return turned


def _joined(record, slices):
    """The stretches one after the other, as if there were no gaps between them."""
    def taken(values):
        return None if values is None else np.concatenate([values[rows] for rows in slices])
    return dataclasses.replace(record, **{
        name: taken(getattr(record, name))
        for name in ("reference", "sensor", "valid", "temperature_c", "unfiltered")})
