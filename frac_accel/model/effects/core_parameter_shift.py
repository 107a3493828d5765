"""Natural frequency and damping other than the model's."""

import dataclasses

import numpy as np

from ..parameters import parameter, parameter_fields
from .base import CORE, Effect, Open, require_oscillator
from .fit_starts import Start, is_far, matching

# Frequencies [of the core's] and damping ratios among which one far from the core's is looked for.
_FREQUENCIES, _RATIOS = np.geomspace(0.25, 4.0, 41), np.geomspace(0.01, 2.0, 12)


@dataclasses.dataclass(frozen=True)
class CoreParameterShift(Effect):
    """The oscillator has another natural frequency and damping ratio, as ageing leaves it."""

    cause = "core_parameter_shift"
    stage = CORE
    explanation = "The sensor's natural frequency and damping are no longer those of the model."
    experiment = ("Sweep across the resonance: place and width of the peak give frequency and "
                  "damping by themselves.")

    natural_frequency_hz: float = parameter("Hz", above=0, maximum=1e8, scale="rate",
                                            reach=(1e-6, 1e3), null="core")
    damping_ratio: float = parameter("1", above=0, maximum=100, scale=1.0, reach=(1e-4, 100.0),
                                     null="core")

    restates_core = True

    @classmethod
    def left_open(cls, axis_model, stds, stamps_std_s):
        own = {field.name: getattr(axis_model.core, field.name, None)
               for field in parameter_fields(cls)}
        if None in own.values() or not own.keys() <= stds.keys():
            return None
        return Open(cls(**own), {name: stds[name] for name in own})

    def change_core(self, core):
        """Raise ModelError where the core is not an oscillator."""
        return dataclasses.replace(require_oscillator(core, self.cause),
                                   natural_frequency_hz=self.natural_frequency_hz,
                                   damping_ratio=self.damping_ratio)

    def restating(self, core, own):
        return dataclasses.replace(self, natural_frequency_hz=core.natural_frequency_hz,
                                   damping_ratio=core.damping_ratio)

    @classmethod
    def starts(cls, view):
        core = view.core
        frequency, ratio = core.natural_frequency_hz, core.damping_ratio
        near = Start(cls(1.003 * frequency, 1.01 * ratio),
                     (cls(1.003 * frequency, ratio), cls(frequency, 1.01 * ratio)), "free")
        if not is_far(view):
            return [near]
        others = [cls(float(factor * frequency), float(other))
                  for factor in _FREQUENCIES for other in _RATIOS]
        return [near, *matching(view, others, 1, lambda effect, s: (
            effect.change_core(core).transfer_function(s) / core.transfer_function(s)))]
