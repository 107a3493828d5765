"""The steps of a diagnosis' fits: within bounds, along true derivatives."""

import dataclasses

import numpy as np
import pytest
from rig.hidden import draw_case
from scipy.optimize import minimize

import frac_accel
from frac_accel.diagnosis.problem import _step
from frac_accel.effects import known_effects
from frac_accel.simulation import AxisSimulator


@pytest.mark.parametrize("seed", range(20))
def test_no_step_within_the_bounds_is_better(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 8))
    jacobian = rng.normal(size=(40, count)) @ (np.eye(count) + rng.normal(size=(count, count)))
    residual = jacobian @ rng.normal(0, 3, count) + rng.normal(size=40)
    gram, slope = jacobian.T @ jacobian, jacobian.T @ residual
    least, most = -rng.uniform(0, 1, count), rng.uniform(0, 1, count)

    def cost(step):
        return step @ gram @ step - 2 * step @ slope

    step = _step(gram, slope, 0.0, least, most)
    assert np.all(step >= least - 1e-12) and np.all(step <= most + 1e-12)
    best = minimize(cost, np.zeros(count), jac=lambda step: 2 * (gram @ step - slope),
                    bounds=list(zip(least, most)), method="L-BFGS-B",
                    options={"ftol": 1e-15, "gtol": 1e-10})
    assert cost(step) <= best.fun + 1e-6 * abs(best.fun)


def test_a_parameter_that_changes_nothing_stays():
    rng = np.random.default_rng(0)
    jacobian = rng.normal(size=(40, 3))
    jacobian[:, 1] = 0
    step = _step(jacobian.T @ jacobian, jacobian.T @ rng.normal(size=40), 0.0, -np.ones(3),
                 np.ones(3))
    assert abs(step[1]) < 1e-9 and np.all(abs(step[[0, 2]]) > 1e-3)


@pytest.mark.parametrize("cause", ["coulomb_friction", "hysteresis", "cubic_stiffness"])
def test_derivatives_beside_a_force_are_those_of_a_finer_simulation(cause):
    case = draw_case(31, [cause, "core_parameter_shift", "low_pass_lag"], excitation="band_noise")
    reference, sensor, celsius = case.samples()
    found = frac_accel.diagnose((reference, sensor), model=case.model(), temperature=celsius)
    problem = found.engine.problem
    effects = {name: known_effects()[name](**values)
               for name, values in case.truth.items()}
    fit = dataclasses.replace(problem.fit(effects, iterations=0), exact=True)
    fine = AxisSimulator(problem.record.reference[:, problem.axis], problem.rate,
                         steps_per_sample=16)

    def output(theta):
        model = problem.axis_model(problem.replaced(effects, fit.unknowns, theta))
        return fine.simulate(model)

    for i, unknown in enumerate(fit.unknowns):
        shift = np.zeros(len(fit.theta))
        shift[i] = 3e-3
        central = (output(fit.theta + shift) - output(fit.theta - shift)) / 6e-3
        central, column = problem.clear(central, fit.free), problem.clear(
            fit.jacobian[:, i], fit.free)
        assert np.std(column - central) < 0.05 * np.std(central), unknown


@pytest.mark.long
@pytest.mark.parametrize("seed", [700000, 41, 42, 43])
def test_friction_that_an_identified_model_took_for_damping_is_no_hysteresis(seed):
    """The level lies far from where the fit begins; hysteresis comes close to friction."""
    case = draw_case(seed, ["coulomb_friction"], excitation="band_noise")
    reference, sensor, celsius = case.samples()
    found = frac_accel.diagnose((reference, sensor), temperature=celsius)
    assert {finding.cause for finding in found.findings} <= {"coulomb_friction",
                                                             "core_parameter_shift"}
