"""Play between the mass and what is measured of it."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import CORE, Effect
from .fit_starts import positive


@dataclasses.dataclass(frozen=True)
class Backlash(Effect):
    """The output y stays while it is within half the gap of the core's motion x, and else follows.

    What it stood at before the record is not known: it is taken to be in the middle.
    """

    cause = "backlash"
    stage = CORE
    explanation = ("There is play: at each turn the output stays until the motion has gone "
                   "through. Dry friction of a mass far below its resonance does the same.")
    experiment = ("Drive one slow sine at several levels: the output is flat after each turn, by "
                  "the same amount at every level.")

    gap: float = parameter("output units", minimum=0, scale=(0.1, "level"), null=0.0)

    def change_motion(self, motion, step_s):
        from ..core.play import follow
        return follow(np.ascontiguousarray(motion), self.gap)

    def live(self, sampling_rate_hz):
        """The inverse remembers the last value: it tells which end of the play is taken."""
        return _Ends(self.gap / 2)

    @classmethod
    def starts(cls, view):
        return [positive(cls(share * view.level), "gap") for share in (0.02, 0.1, 0.4)]


class _Ends:
    """Motion from the output: at the end of the play that the output's direction tells.

    While the output stays or turns, or noise hides its direction, all that is known is the play's
    width.
    """

    def __init__(self, half):
        self._half, self._last = half, None
        self._moved = np.zeros(1)

    def simulate(self, values, circumstances):
        return values

    def invert(self, values, variance, circumstances):
        if not len(values):
            return values, variance
        from scipy.special import erf
        last = values[:1] if self._last is None else self._last[0]
        last_variance = variance[:1] if self._last is None else self._last[1]
        moved = np.diff(np.concatenate([last, values]))
        noise = variance + np.concatenate([last_variance, variance[:-1]])
        # of a motion that turns between two samples, the mean direction counts
        bend = np.diff(np.concatenate([self._moved, moved]))
        spread = noise + bend**2 / 12
        self._last, self._moved = (values[-1:].copy(), variance[-1:].copy()), moved[-1:]
        with np.errstate(divide="ignore", invalid="ignore"):
            sign = erf(moved / np.sqrt(2 * spread))
        sign = np.where(spread > 0, sign, np.sign(moved))
        return (values + self._half * sign,
                variance + self._half**2 / 3 * (1 - sign**2))
