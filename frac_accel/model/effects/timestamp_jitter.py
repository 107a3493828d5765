"""Stamps that scatter."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import STAMPS, Effect, Reading

# Share of the reference's stamps that the sensor's samples have, too, from which one logger has
# stamped both.
_SHARED = 0.9


@dataclasses.dataclass(frozen=True)
class TimestampJitter(Effect):
    """Stamps scatter around the instants of the samples, whose values are as they are."""

    cause = "timestamp_jitter"
    read_off = True
    stage = STAMPS
    explanation = "The stamps scatter around the instants at which the samples were taken."
    experiment = ("Let the sensor's own clock or a hardware trigger stamp the samples: the "
                  "scatter goes, and the error with it.")

    @classmethod
    def of_record(cls, found, measured):
        return cls(found.jitter_rms_s) if found.jitter_rms_s and not found.rounds_stamps else None

    def reading(self, seen):
        """Beside a simulation whose samples are taken at the stamps that they carry; None of
        batches, whose scatter is no jitter, and of stamps that the reference has, too: one logger
        has stamped both, and sample belongs to sample."""
        words = next((words for words in seen.found.words if "scatter" in words), None)
        both = [topic.stamps_ns for topic in seen.record.topics or ()]
        if words is None or (both and np.isin(*both).mean() > _SHARED):
            return None
        values, at_instants, at_stamps = seen.at_stamps()
        return Reading({"rms_s": self.rms_s / np.sqrt(2 * seen.found.samples)},
                       values - at_stamps, values - at_instants, words)

    rms_s: float = parameter("s", minimum=0, maximum=10, null=0.0)
