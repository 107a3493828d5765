"""Clock that runs at another rate than the reference's."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DELAY, Effect
from .fit_starts import Start, drifting_lags, finite, free


@dataclasses.dataclass(frozen=True)
class ClockSkew(Effect):
    """The value stamped t belongs to t (1 + 1e-6 skew), t from the record's start."""

    cause = "clock_skew"
    stage = DELAY
    explanation = "The sensor's clock runs at another rate than the reference's."
    shows_with_time = True
    experiment = ("Record longer, with a sharp event at the beginning and at the end: a skew lets "
                  "the lag grow from one to the other.")

    common_to_axes = True

    # no crystal is off by more than this
    skew_ppm: float = parameter("1e-6", minimum=-10_000, maximum=10_000, scale=100.0,
                                null=0.0)

    def std_by_stamps(self, record):
        return {"skew_ppm": record.rates_std_ppm}

    def clock_ratio(self):
        return 1 + 1e-6 * self.skew_ppm

    @classmethod
    def starts(cls, view):
        lags = [(cls(float(np.clip(-1e6 * growth, -9e3, 9e3))), lag_s)
                for growth, lag_s in drifting_lags(view) if growth]
        return [free(cls(1.0), "skew_ppm"), finite(cls(100.0)), finite(cls(-100.0)),
                *(Start(effect, (effect,), "finite", lag_s=lag_s) for effect, lag_s in lags)]
