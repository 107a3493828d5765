"""Delay between the motion and its stamp."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DELAY, Effect, Open
from .fit_starts import bulk_shift, finite, free


@dataclasses.dataclass(frozen=True)
class TimeDelay(Effect):
    """The value stamped t belongs to t - delay; the correction takes it out of the stamp."""

    cause = "time_delay"
    stage = DELAY
    explanation = "The stamps lag the motion by delay_s (negative: they lead)."
    everyday = True
    experiment = ("Excite a wider band, up to frequencies where a delay of this size turns the "
                  "phase by radians: its phase is a straight line over frequency, and no "
                  "amplitude changes.")

    # no accelerometer is later than this: a larger number is in milliseconds
    delay_s: float = parameter("s", minimum=-10, maximum=10, scale="interval", null=0.0)

    common_to_axes = True
    identified_as = "delay_s"

    @classmethod
    def left_open(cls, axis_model, stds, stamps_std_s):
        std = float(np.hypot(stds.get("delay_s", 0.0), stamps_std_s))
        # a filter's own delay is no part of it
        own = next((effect for effect in axis_model.effects if isinstance(effect, cls)), cls(0.0))
        return Open(own, {"delay_s": std}) if std else None

    def std_by_stamps(self, record):
        return {"delay_s": record.lag_std_s}

    def pure_delay_s(self):
        return self.delay_s

    @classmethod
    def starts(cls, view):
        begin = [free(cls(view.delay_s + 0.1 / view.rate))]
        lag = bulk_shift(view.simulated, view.measured, view.used)
        return begin + ([finite(cls(view.delay_s + lag / view.rate))] if lag else [])
