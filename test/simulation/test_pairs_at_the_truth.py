"""Two causes together are simulated as by the independent simulator: with the true parameters, and
no search, nothing but noise is left."""

import itertools

import numpy as np
import pytest
from rig.hidden import INSEPARABLE, draw_case
from rig.sensor import CAUSES, SECOND_SET

from frac_accel.diagnosis.other_axes import OtherAxes
from frac_accel.diagnosis.problem import Problem
from frac_accel.model.effects import known_effects
from frac_accel.record import Record

# They add noise of their own, or their phase is not among the truth.
_NOISY = {"reference_noise", "sampling_jitter", "polled_readout", "interference_bursts",
          "timestamp_jitter", "dropped_samples", "clipping", "quantization", "tone_interference"}
# A stiff stop needs finer steps, and an average of the reference has lost what lies at its zeros.
_INEXACT = {"impact_stop", "reference_smoothing"}
# The rig's sensors are the same on all axes.
_ALIKE = OtherAxes(alike=True, same_laws=True)
_BENT = {"quadratic_stiffness", "cubic_stiffness", "hysteresis", "coulomb_friction",
         "stiffness_drift", "quadratic_damping", "backlash", "gain_drift", "gain_step",
         "temperature_sensitivity"}
# The rig has the mode of a fixture behind the mass.
_BEHIND = "second_resonance"
# Cost over that of the noise.
_LEFT = 1.3
_AT_A_TIME = 8


def pairs():
    causes = [cause for cause in (*CAUSES, *SECOND_SET) if cause not in _NOISY | _INEXACT
              and not known_effects()[cause].read_off]
    found = [pair for pair in itertools.combinations(causes, 2)
             if not any(set(pair) == other for other in map(set, INSEPARABLE))
             and not (_BEHIND in pair and set(pair) & _BENT)]
    # a spring or a gain that changes behind a high-pass of the reference, or a turn, and what the
    # other axes say with the same ones come first
    first = [pair for before in ("reference_ac_coupling", "misalignment", "cross_axis_sensitivity")
             for pair in found if before in pair and set(pair) & _BENT]
    order = np.random.default_rng(2026).permutation(len(found))
    return first + [found[i] for i in order if found[i] not in first]


@pytest.mark.parametrize("part", [pytest.param(part, marks=[pytest.mark.thorough] + (
    [pytest.mark.long] if part > 1 else [])) for part in range(12)])
def test_true_parameters_leave_noise(part):
    left = {}
    for seed, pair in enumerate(pairs()[part * _AT_A_TIME:(part + 1) * _AT_A_TIME]):
        try:
            case = draw_case(5000 + seed, pair)
        except RuntimeError:
            continue  # no draw has effects of the wanted size
        reference, sensor, celsius = case.samples()
        record = Record.of(reference, sensor, "x", celsius)
        problem = Problem(record, 0, case.model(), record.valid, others=_ALIKE)
        effects = {cause: known_effects()[cause](**parameters)
                   for cause, parameters in case.truth.items()}
        left[pair] = problem.cost(effects) / problem.count / case.noise_std**2
    assert len(left) > _AT_A_TIME / 2
    assert {pair: share for pair, share in left.items() if not share < _LEFT} == {}
