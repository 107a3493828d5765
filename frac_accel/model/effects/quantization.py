"""Resolution of the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import QUANTIZATION, Effect, Reading

# Largest share of an error's power that is ascribed to rounding.
_MOST = 0.99


@dataclasses.dataclass(frozen=True)
class Quantization(Effect):
    """Values are rounded to whole steps."""

    cause = "quantization"
    read_off = True
    stage = QUANTIZATION
    explanation = "The output has a coarse resolution."
    experiment = "Repeat at a tenth of the level: the steps between the values stay as large."

    step: float = parameter("output units", above=0)

    @classmethod
    def of_record(cls, found, measured):
        return cls(found.step) if found.step else None

    def reading(self, seen):
        """Where noise is rounded too, rounding the simulated values gains nothing.

        What rounding has added is then known by its power alone, step**2 / 12 (B. Widrow,
        I. Kollar, *Quantization Noise* (2008)).
        """
        if not seen.is_coarse:
            return None
        before = (seen.measured - seen.output)[seen.used]
        after = (seen.measured - self.simulate(seen.output, None))[seen.used]
        share = min(self.step**2 / 12 / np.mean(before**2), _MOST)
        if np.mean(after**2) > (1 - share) * np.mean(before**2):
            after = before * np.sqrt(1 - share)
        return Reading({"step": 1e-6 * self.step}, before, after,
                       next(words for words in seen.found.words if "multiples" in words))

    def simulate(self, values, circumstances):
        return self.step * np.round(values / self.step)

    def invert(self, values, variance, circumstances):
        """The values as they are, with the variance of a uniform error of one step's width."""
        return values, variance + self.step**2 / 12
