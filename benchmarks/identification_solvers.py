"""The search of `identify` in the time domain beside `scipy.optimize.least_squares`.

Levenberg-Marquardt with bounds and geodesic acceleration (`fit.output_error`), beside scipy's trust
region on the same projected residual and derivatives, from the same starts. Random sensors from 60
to 200 Hz, 5 s at 2 kHz, noise of 1 %. (The fit to a frequency response is scipy's.)
"""

import time

import numpy as np
from scipy.optimize import least_squares

from frac_accel import SensorModel, simulate
from frac_accel.identification.fit import output_error
from frac_accel.identification.judge.candidate import STRUCTURES
from frac_accel.model.core import Oscillator

RATE_HZ, SAMPLES, SENSORS = 2000.0, 10_000, 10


def scipys(problem, theta, iterations):
    """Stands in for `output_error._Problem.search`."""
    seen = {}

    def state(x):
        key = x.tobytes()
        if key not in seen:
            seen.clear()
            seen[key] = problem.state(x)
        return seen[key]

    def slopes(x):
        here = state(x)
        count = len(here.linear)
        known, rows = here.rows[:count], here.linear[0] * here.rows[count:]
        gram = here.gram[:count, :count]
        return -(rows - (np.linalg.solve(gram, known @ rows.T)).T @ known).T

    inside = np.clip(theta, problem.low + 1e-9, problem.high - 1e-9)
    found = least_squares(lambda x: state(x).residual, inside, slopes,
                          (problem.low, problem.high), x_scale="jac", max_nfev=iterations,
                          ftol=1e-9, xtol=1e-9, gtol=1e-12)
    return output_error.dataclasses.replace(problem.state(found.x), converged=found.status > 0)


def records():
    """(structure's name, reference, sensor) of random sensors."""
    rng = np.random.default_rng(7)
    for number in range(SENSORS):
        name = ("oscillator", "fractional")[number % 2]
        order = 1.0 if name == "oscillator" else rng.uniform(0.5, 1.5)
        model = SensorModel(Oscillator(rng.uniform(60, 200), rng.uniform(0.05, 0.5), order,
                                       rng.uniform(0.5, 2)))
        reference = rng.normal(size=SAMPLES)
        clean = simulate(model, reference, RATE_HZ, axis="x")
        yield name, reference, clean + 0.01 * clean.std() * rng.normal(size=SAMPLES)


def compared(ours, theirs, cost):
    """Time of both, alternating, and by how much the second one's cost exceeds the first's."""
    best = {ours: np.inf, theirs: np.inf}
    for _ in range(3):
        for way in best:
            start = time.process_time()
            result = way()
            best[way] = min(best[way], time.process_time() - start)
            if way is ours:
                own = cost(result)
            else:
                other = cost(result)
    return best[ours], best[theirs], other / own - 1


def run():
    """Rows of the table."""
    rows, own = {}, output_error._Problem.search
    for name, reference, sensor in records():
        def fit(search, name=name, reference=reference, sensor=sensor):
            output_error._Problem.search = search
            try:
                return output_error.fit_output_error(STRUCTURES[name], reference, sensor, RATE_HZ,
                                                     uncertainty=False)
            finally:
                output_error._Problem.search = own
        rows.setdefault(name, []).append(
            compared(lambda: fit(own), lambda: fit(scipys),
                     lambda found: np.nansum(found.residual**2)))
    return [{"structure": name, "ours [ms]": 1e3 * np.mean([entry[0] for entry in entries]),
             "scipy [ms]": 1e3 * np.mean([entry[1] for entry in entries]),
             "scipy's cost above ours, at worst": max(entry[2] for entry in entries),
             "at best": min(entry[2] for entry in entries)} for name, entries in rows.items()]
