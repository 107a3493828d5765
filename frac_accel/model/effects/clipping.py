"""Range that the output cannot leave."""

import dataclasses

import numpy as np

from ...errors import ModelError
from ..parameters import parameter
from .base import CLIPPING, Effect, Reading

# Share of a limit from which values are near it, how many of them tell, and factor by which what is
# left there may be larger than elsewhere.
_NEAR = 0.8
_TELL = 20
_LARGER = 3.0
# Share of the samples at a limit whose motion must go beyond it, and how far (RMS) beside what is
# left elsewhere, for one stretch to be enough.
_BEYOND, _FAR = 0.9, 5.0


@dataclasses.dataclass(frozen=True)
class Clipping(Effect):
    """Values beyond the limits come out as the limits."""

    cause = "clipping"
    read_off = True
    stage = CLIPPING
    explanation = "Values beyond the sensor's range are cut off."
    experiment = "Repeat at half the level: nothing is cut then, and the output follows again."

    lower: float = parameter("output units")
    upper: float = parameter("output units")

    def __post_init__(self):
        if not self.lower < self.upper:
            raise ModelError(f"effects: clipping from {self.lower:g} to {self.upper:g} given, "
                             "expected lower below upper")

    @classmethod
    def of_record(cls, found, measured):
        if found.lower is None and found.upper is None:
            return None
        beyond = 1e3 * float(np.max(np.abs(measured)))
        return cls(-beyond if found.lower is None else found.lower,
                   beyond if found.upper is None else found.upper)

    def spoiled(self, measured):
        return (measured <= self.lower) | (measured >= self.upper)

    def reading(self, seen):
        """All samples count: nothing was fitted to those at a limit.

        None where the values bend before they come to a limit: nothing is cut off then.
        """
        measured, output, used = seen.as_recorded()
        error, at_limit = measured - output, self.spoiled(measured)
        if self._bends(measured, error, used & ~at_limit):
            return None
        resolution = (seen.found.step or 0.0) / np.sqrt(12)
        # one that was never reached is not known
        reached = [name for name in ("lower", "upper") if getattr(seen.found, name) is not None]
        return Reading(dict.fromkeys(reached, resolution),
                       error, measured - self.simulate(output, None),
                       "; ".join(words for words in seen.found.words if "limit" in words),
                       evident=self._goes_beyond(measured, error, used))

    def _bends(self, measured, error, free):
        centre = np.median(measured)  # gravity may stand far from zero
        near = free & ((measured - centre <= _NEAR * (self.lower - centre))
                       | (measured - centre >= _NEAR * (self.upper - centre)))
        away = free & ~near
        if near.sum() < _TELL or away.sum() < _TELL:
            return False
        return np.std(error[near]) > _LARGER * np.std(error[away])

    def _goes_beyond(self, measured, error, used):
        """Whether the motion goes on far beyond where the values stand."""
        low, high = measured <= self.lower, measured >= self.upper
        if not (low | high).any():
            return False
        beyond = np.r_[error[low] > 0, error[high] < 0]
        return bool(beyond.mean() >= _BEYOND and np.sqrt(np.mean(error[low | high]**2))
                    > _FAR * np.std(error[used]))

    def simulate(self, values, circumstances):
        return np.clip(values, self.lower, self.upper)

    def limits(self):
        return self.lower, self.upper
