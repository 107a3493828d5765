"""Messages that are lost."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import STAMPS, Effect, Reading

# Samples of which fewer may seem to be missing where stamps scatter by more than such a share of
# the sampling interval (RMS).
_SEVERAL, _SCATTER = 9, 0.1


@dataclasses.dataclass(frozen=True)
class DroppedSamples(Effect):
    """A share of the samples is missing; those that are there keep their values."""

    cause = "dropped_samples"
    read_off = True
    stage = STAMPS
    explanation = "Some of the sensor's messages are lost."
    experiment = "Number the messages at their source: missing numbers are messages that were lost."

    @classmethod
    def of_record(cls, found, measured):
        return cls(found.dropped_fraction) if found.missing else None

    def reading(self, seen):
        """Beside a simulation whose samples are counted as if none were lost; None of so few among
        instants that scatter that chance may do it."""
        if seen.found.missing < _SEVERAL \
                and seen.found.jitter_rms_s * seen.record.sampling_rate_hz > _SCATTER:
            return None
        share, whole = self.fraction, seen.found.samples + seen.found.missing
        values, at_instants, as_counted = seen.as_counted()
        return Reading({"fraction": float(np.sqrt(share * (1 - share) / whole))},
                       values - as_counted, values - at_instants,
                       next(words for words in seen.found.words if "missing" in words))

    fraction: float = parameter("1", minimum=0, below=1, null=0.0)
