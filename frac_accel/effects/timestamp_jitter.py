"""Stamps that scatter."""

import dataclasses

from ..parameters import parameter
from .base import STAMPS, Effect


@dataclasses.dataclass(frozen=True)
class TimestampJitter(Effect):
    """Stamps scatter around the instants of the samples, whose values are as they are."""

    cause = "timestamp_jitter"
    read_off = True
    stage = STAMPS
    explanation = "The stamps scatter around the instants at which the samples were taken."
    experiment = ("Let the sensor's own clock or a hardware trigger stamp the samples: the "
                  "scatter goes, and the error with it.")

    rms_s: float = parameter("s", minimum=0, maximum=10)
