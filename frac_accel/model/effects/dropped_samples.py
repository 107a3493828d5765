"""Messages that are lost."""

import dataclasses

import numpy as np

from ...errors import ModelError
from ..parameters import coefficients, parameter
from .base import STAMPS, Effect, Reading

# Samples of which fewer may seem to be missing where stamps scatter by more than such a share of
# the sampling interval (RMS).
_SEVERAL, _SCATTER = 9, 0.1
# Places at which some are missing: fewer are interruptions, which the data's words tell.
_PLACES = 6


@dataclasses.dataclass(frozen=True)
class DroppedSamples(Effect):
    """A share of the samples is missing; those that are there keep their values.

    Where the stamps count on all the same, the value stamped t after each loss belongs to a later
    instant.
    """

    cause = "dropped_samples"
    read_off = True
    common_to_axes = True
    stage = STAMPS
    explanation = "Some of the sensor's messages are lost."
    experiment = "Number the messages at their source: missing numbers are messages that were lost."

    @property
    def counts_from_start(self):
        return bool(self.at_s)

    def __post_init__(self):
        if len(self.at_s) != len(self.lost_s):
            raise ModelError(f"dropped_samples.lost_s: {len(self.lost_s)} values given, expected "
                             f"as many as instants in at_s: {len(self.at_s)}")

    def time_steps(self):
        return tuple((at_s, -lost_s) for at_s, lost_s in zip(self.at_s, self.lost_s))

    @classmethod
    def of_record(cls, found, measured):
        return cls(found.dropped_fraction) if found.missing else None

    @classmethod
    def of_slips(cls, at_s, counts, interval_s, samples):
        lost = float(np.sum(counts))
        return cls(lost / (samples + lost), tuple(map(float, at_s)),
                   tuple(map(float, counts * interval_s)))

    def reading(self, seen):
        """Beside a simulation whose samples are counted as if none were lost; None of so few among
        instants that scatter that chance may do it, and at few places."""
        scatters = seen.found.jitter_rms_s * seen.record.sampling_rate_hz > _SCATTER
        if seen.found.missing < _SEVERAL and scatters \
                or not self.at_s and seen.record.topics[1].places_missing < _PLACES:
            return None
        share, whole = self.fraction, seen.found.samples + seen.found.missing
        std = {"fraction": float(np.sqrt(share * (1 - share) / whole))}
        if self.at_s:
            error = (seen.measured - seen.output)[seen.used]
            return Reading(std, error, error, self._places())
        values, at_instants, as_counted = seen.as_counted()
        return Reading(std,
                       values - as_counted, values - at_instants,
                       next(words for words in seen.found.words if "missing" in words))

    def _places(self):
        """Where the motion shows that samples are lost, by the shift of all that follows."""
        places = ", ".join(f"{1e3 * lost_s:.3g} ms from {at_s:.4g} s on"
                           for at_s, lost_s in zip(self.at_s, self.lost_s))
        return ("the stamps count on although samples are lost: what follows is ahead by whole "
                f"sampling intervals, {places}")

    # no fit varies what was counted
    fraction: float = parameter("1", minimum=0, below=1, null=0.0, fixed=True)
    # where the stamps count on: those of the first samples after a loss, and how far these are off
    at_s: tuple = coefficients("s", ())
    lost_s: tuple = coefficients("s", ())
