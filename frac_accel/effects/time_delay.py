"""Delay between the motion and its stamp."""

import dataclasses

from ..parameters import parameter
from .base import DELAY, Effect
from .fit_starts import bulk_shift, finite, free


@dataclasses.dataclass(frozen=True)
class TimeDelay(Effect):
    """The value stamped t belongs to t - delay; the correction takes it out of the stamp."""

    cause = "time_delay"
    stage = DELAY
    explanation = ("The samples are stamped later (below zero: earlier) than the motion that they "
                   "show.")
    experiment = ("Excite a wider band, up to frequencies where a delay of this size turns the "
                  "phase by radians: its phase is a straight line over frequency, and no "
                  "amplitude changes.")

    # no accelerometer is later than this: a larger number is in milliseconds
    delay_s: float = parameter("s", minimum=-10, maximum=10)

    def pure_delay_s(self):
        return self.delay_s

    @classmethod
    def starts(cls, view):
        begin = [free(cls(view.delay_s + 0.1 / view.rate))]
        lag = bulk_shift(view.simulated, view.measured, view.used)
        return begin + ([finite(cls(view.delay_s + lag / view.rate))] if lag else [])
