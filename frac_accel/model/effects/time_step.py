"""Clock that jumps."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import DELAY, Effect, Reading
from .fit_starts import bulk_shift, finite, jump_between, jumps

# Share of its size, and time [s], by which a jump of stamps may be another one, and what stamps
# are rounded to [s].
_SAME, _NEAR_S, _LEAST_S = 0.1, 1.0, 1e-9


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
    def of_record(cls, found, measured):
        return cls(found.jump.at_s, found.jump.size_s).beside_jump(found.jump) if found.jump \
            else None

    def beside_jump(self, jump):
        same = abs(self.step_s - jump.size_s) < _SAME * abs(jump.size_s) \
            and abs(self.at_s - jump.at_s) < _NEAR_S
        return _Undone(self.at_s, self.step_s) if same else self

    @classmethod
    def starts(cls, view):
        slope = -np.gradient(view.simulated) * view.rate
        return [finite(cls(at_s, float(np.clip(step_s, -9, 9))))
                for at_s, step_s in [*jumps(view, slope), *_far(view)]]


@dataclasses.dataclass(frozen=True)
class _Undone(TimeStep):
    """The same of a record whose samples were laid out evenly: it changes nothing any more."""

    read_off = True

    def on_stamps(self):
        return TimeStep(self.at_s, self.step_s)

    def time_steps(self):
        return ()

    def reading(self, seen):
        """Beside a simulation whose samples are taken at the stamps that they carry."""
        values, at_instants, at_stamps = seen.at_stamps(even=False)
        clock = seen.record.topics[1].clock
        return Reading({"at_s": 1 / (np.sqrt(12) * clock.rate_hz),
                        "step_s": float(np.hypot(
                            clock.scatter_s * np.sqrt(12 / seen.found.samples), _LEAST_S))},
                       values - at_stamps, values - at_instants,
                       next(words for words in seen.found.words if "clock was set" in words),
                       evident=True)


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
