"""Delay of the recorded reference."""

import dataclasses

from ..parameters import parameter
from .base import REFERENCE, Effect
from .fit_starts import bulk_shift, finite, positive


@dataclasses.dataclass(frozen=True)
class ReferenceDelay(Effect):
    """The reference's value stamped t belongs to t - delay.

    Nothing but the sign tells it from a `time_delay` of the sensor, whose stamps may be early.
    """

    cause = "reference_delay"
    stage = REFERENCE
    of_reference = True
    explanation = "The reference is stamped later than the motion that it shows."
    experiment = ("Strike both at once while a third clock, such as a camera, looks on: the one "
                  "whose stamp is late (or early) shows.")

    delay_s: float = parameter("s", above=0, maximum=10, scale="interval", reach=(1e-6, 1e6),
                               null=0.0)

    common_to_axes = True
    # a late reference is more usual than a sensor whose stamps are early
    mirrors = "time_delay"

    def pure_delay_s(self):
        return -self.delay_s

    def std_by_stamps(self, record):
        return {"delay_s": record.lag_std_s}

    @classmethod
    def mirrored(cls, effect):
        """The same as a sensor's delay below zero; None of one that a sensor has."""
        return cls(-effect.delay_s) if effect.delay_s < 0 else None

    @classmethod
    def starts(cls, view):
        lag = bulk_shift(view.simulated, view.measured, view.used)
        begin = [positive(cls(0.1 / view.rate), "delay_s")]
        return begin + ([finite(cls(-lag / view.rate))] if lag < 0 else [])
