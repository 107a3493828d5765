"""Sensitivity that differs from the model's."""

import dataclasses

import numpy as np

from ..parameters import parameter
from .base import GAIN, Effect, Open
from .fit_starts import finite, free


@dataclasses.dataclass(frozen=True)
class SensitivityError(Effect):
    """Constant gain, as a ratio to the sensitivity of the core."""

    cause = "sensitivity_error"
    stage = GAIN
    explanation = "The sensitivity differs from the model's by a constant ratio."
    everyday = True
    experiment = ("Compare with the reference at one frequency far below the resonance: a ratio "
                  "of amplitudes other than 1 there is the sensitivity.")

    gain: float = parameter("1", scale=1.0, null=1.0)

    restates_core = True
    is_constant = True

    @classmethod
    def left_open(cls, axis_model, stds, stamps_std_s):
        if "sensitivity" not in stds:
            return None
        return Open(cls(1.0), {"gain": stds["sensitivity"] / abs(axis_model.core.sensitivity)})

    def restated(self, core):
        return dataclasses.replace(core, sensitivity=core.sensitivity * self.gain)

    def restating(self, core, own):
        return dataclasses.replace(self, gain=core.sensitivity / own.sensitivity)

    def transfer_function(self, s):
        return np.full_like(s, self.gain, dtype=complex)

    def reference_gain(self):
        return abs(self.gain)

    @classmethod
    def starts(cls, view):
        return [free(cls(1.01)), finite(cls(-1.0))]
