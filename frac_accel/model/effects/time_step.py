"""Clock that jumps."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DELAY, Effect
from .fit_starts import bulk_shift, finite, jump_between, jumps


@dataclasses.dataclass(frozen=True)
class TimeStep(Effect):
    """From the stamp `at_s` after the record's start on, the value stamped t belongs to t - step.

    The correction moves the stamps back, and never lets them go backwards: `time_steps.moved`.
    """

    cause = "time_step"
    stage = DELAY
    explanation = "The stamps jump against the motion at one instant, as where a clock is set."
    shows_with_time = True
    counts_from_start = True
    experiment = ("Number the samples at their source, and record a sharp event before and after: "
                  "the numbers go on evenly where the stamps jump.")

    common_to_axes = True

    at_s: float = parameter("s", minimum=0, scale=(16, "interval"), step=0.5, jumps=True)
    step_s: float = parameter("s", minimum=-10, maximum=10, scale="interval", null=0.0)

    def time_steps(self):
        return ((self.at_s, self.step_s),)

    @classmethod
    def starts(cls, view):
        slope = -np.gradient(view.simulated) * view.rate
        return [finite(cls(at_s, float(np.clip(step_s, -9, 9))))
                for at_s, step_s in [*jumps(view, slope), *_far(view)]]


def _far(view):
    """Jumps of many samples, which the slope does not show: by the lag of the record's end."""
    found = []
    for share in (0.5, 0.8):
        late = view.used & (np.arange(len(view.used)) >= share * len(view.used))
        lag = bulk_shift(view.simulated, view.measured, late) if late.any() else 0
        if lag:
            moved = view.measured - np.roll(view.simulated, lag)
            found.append((jump_between(view, view.residual, moved), lag / view.rate))
    return [(at_s, step_s) for at_s, step_s in found if at_s is not None]
