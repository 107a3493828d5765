"""Description of a sensor's output by a fitted static map."""

import dataclasses
import functools

import numpy as np

from ...errors import ModelError
from ..parameters import coefficients
from .base import DEAD_ZONE, Effect

# Points between two knots, and how far the straight ends reach, in widths of the map.
_FINE = 32
_BEYOND = 1e3


@dataclasses.dataclass(frozen=True)
class EmpiricalMap(Effect):
    """A description of what a sensor does besides, never a cause.

    The output is a monotonic function of what it would be: through (`before`, `after`) by a
    piecewise cubic without overshoot (F. N. Fritsch, J. Butland, *SIAM J. Sci. Stat. Comput.* 5
    (1984) 300-304), straight beyond. `std` is the standard uncertainty of `after`.
    `diagnosis.empirical_map.fit_empirical_map` fits one.
    """

    cause = "empirical_map"
    stage = DEAD_ZONE
    explanation = ("A fitted curve between expected and measured values describes what no known "
                   "cause explains; it says nothing of where it comes from.")
    experiment = ("Nothing that could be measured belongs to its knots; look for the cause where "
                  "the curve is bent most.")
    # no search may take it for a cause
    read_off = True

    before: tuple = coefficients()
    after: tuple = coefficients()
    std: tuple = coefficients()

    def __post_init__(self):
        if not len(self.before) == len(self.after) == len(self.std) >= 2:
            raise ModelError(f"empirical_map: {len(self.before)}, {len(self.after)} and "
                             f"{len(self.std)} numbers given, expected as many of each, at least 2")
        for name in ("before", "after"):
            if not np.all(np.diff(getattr(self, name)) > 0):
                raise ModelError(f"empirical_map.{name}: expected ascending numbers")
        if min(self.std) < 0:
            raise ModelError(f"empirical_map.std: {min(self.std):g} given, expected at least 0")

    @functools.cached_property
    def _curve(self):
        """Points between which the map is straight, so that either way undoes the other."""
        from scipy.interpolate import PchipInterpolator
        x, y = np.array(self.before), np.array(self.after)
        place = np.linspace(0, len(x) - 1, _FINE * (len(x) - 1) + 1)
        fine = np.interp(place, np.arange(len(x)), x)
        curve = PchipInterpolator(x, y)(fine)
        reach = _BEYOND * (x[-1] - x[0])
        slopes = [(y[1] - y[0]) / (x[1] - x[0]), (y[-1] - y[-2]) / (x[-1] - x[-2])]
        return (np.r_[x[0] - reach, fine, x[-1] + reach],
                np.r_[y[0] - slopes[0] * reach, curve, y[-1] + slopes[1] * reach])

    def simulate(self, values, circumstances):
        return np.interp(values, *self._curve)

    def invert(self, values, variance, circumstances):
        before, after = self._curve
        found = np.interp(values, after, before)
        piece = np.clip(np.searchsorted(after, values) - 1, 0, len(after) - 2)
        slope = np.diff(after)[piece] / np.diff(before)[piece]
        own = np.interp(found, self.before, self.std)
        return found, (variance + own**2) / slope**2
