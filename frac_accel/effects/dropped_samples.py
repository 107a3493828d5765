"""Messages that are lost."""

import dataclasses

from ..parameters import parameter
from .base import STAMPS, Effect


@dataclasses.dataclass(frozen=True)
class DroppedSamples(Effect):
    """A share of the samples is missing; those that are there keep their values."""

    cause = "dropped_samples"
    read_off = True
    stage = STAMPS
    explanation = "Some of the sensor's messages are lost."
    experiment = "Number the messages at their source: missing numbers are messages that were lost."

    fraction: float = parameter("1", minimum=0, below=1)
