"""Resolution of the output."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import QUANTIZATION, Effect, Reading

# Share of an error's power that rounding must have where the values have been put on other
# instants, and largest share that is ascribed to it.
_LEAST, _MOST = 0.2, 0.99
# Share of a rounding error (RMS) that a model must err by, at least: one that errs by less has the
# same lattice.
_SEEN = 0.1
# Stretches of a record from each of which rounding takes the same power.
_STRETCHES = 40


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

    @classmethod
    def recognised(cls, seen, shown):
        if seen.found.step:
            return super().recognised(seen, shown)
        # values that were put on other instants have no lattice; what was published has
        step = seen.record.step("sensor", seen.axis)
        reading = cls(step).reading(seen) if step else None
        return (cls(step), reading) if reading is not None \
            and step**2 / 12 > _LEAST * np.mean(reading.before**2) else None

    def reading(self, seen):
        """Where noise is rounded too, rounding the simulated values gains nothing.

        What rounding has added is then known by its power alone, step**2 / 12 (B. Widrow,
        I. Kollar, *Quantization Noise* (2008)).
        """
        moved = seen.found.step is None
        if not (seen.is_coarse or moved):
            return None
        values, output, used = seen.as_recorded()
        before = (values - output)[used]
        rounding, one = self.step**2 / 12, seen.of_one_error
        if np.mean(before**2) < _SEEN**2 * rounding:
            return None
        after = (values - self.simulate(output, None))[used]
        errors = [(before, rounding)]
        if seen.record.band_hz is not None and one is not None:
            # what the values show beyond the band that is compared drowns no rounding within it
            errors.append(((seen.measured - seen.output)[seen.used], rounding * np.sum(one**2)))
        for error, power in errors:
            share = min(power / np.mean(error**2), _MOST)
            if np.mean(after**2) > (1 - share) * np.mean(before**2):
                before, after = error, _without(error, share)
        return Reading({"step": 1e-6 * self.step}, before, after,
                       next(words for words in seen.found.words if "multiples" in words),
                       evident=moved)

    def simulate(self, values, circumstances):
        return self.step * np.round(values / self.step)

    def invert(self, values, variance, circumstances):
        """The values as they are, with the variance of a uniform error of one step's width."""
        return values, variance + self.step**2 / 12


def _without(error, share):
    """An error without a share of its power, the same power in each stretch: where there is more
    error, rounding is less of it, which is what makes the share uncertain."""
    parts = np.array_split(error, _STRETCHES)
    power = np.repeat([np.mean(part**2) if len(part) else 1.0 for part in parts],
                      [len(part) for part in parts])
    rest = 1 - np.minimum(share * np.mean(error**2) / np.maximum(power, 1e-300), _MOST)
    left = error * np.sqrt(rest)
    # stretches with less error than that have given less
    return left * np.sqrt((1 - share) * np.mean(error**2) / max(np.mean(left**2), 1e-300))
