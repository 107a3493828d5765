"""Forces that know the time, the speed or a stop: against `solve_ivp`, undone, found again."""

import numpy as np
import pytest
from second_set_bench import CORE, RATE, Multisine, model, samples, times

from frac_accel import Corrector, simulate
from frac_accel.diagnosis import diagnose
from frac_accel.errors import FracAccelError
from frac_accel.model.core.bouc_wen import follow_one_way

W, Z = 2 * np.pi * CORE["natural_frequency_hz"], CORE["damping_ratio"]
# Parameters, and q'' at time t with the driving acceleration u = S a.
CAUSES = {
    "stiffness_drift": ({"rate_per_s": 0.02}, lambda t, q, v, u: (
        (W * (1 + 0.02 * t))**2 * (u - q) - 2 * Z * W * (1 + 0.02 * t) * v)),
    # as a capacitive sensor's or a geophone's: m q'' + c q' + k(t) q = m u
    "stiffness_drift of what reads the displacement": (
        {"rate_per_s": 0.02, "reads": "displacement"}, lambda t, q, v, u: (
            W**2 * u - 2 * Z * W * v - (W * (1 + 0.02 * t))**2 * q)),
    "quadratic_damping": ({"coefficient": 0.15}, lambda t, q, v, u: (
        W**2 * (u - q - 0.15 * v * abs(v) / W**2) - 2 * Z * W * v)),
    "impact_stop": ({"gap": 1.6, "stiffness": 15.0}, lambda t, q, v, u: (
        W**2 * (u - q - 15.0 * (q - np.clip(q, -1.6, 1.6))) - 2 * Z * W * v)),
}


def effect_of(case):
    return {"cause": case.split()[0], **CAUSES[case][0]}


def record(cause, seed, duration_s=8.0):
    """From rest, in a motion that begins smoothly."""
    sine = Multisine(np.random.default_rng(seed), band_hz=(1.0, 100.0))
    t = times(duration_s)

    def begun(now):
        return np.minimum(now / 0.2, 1.0)**3

    law = CAUSES[cause][1]
    moved = sine.nonlinear(t, lambda now, q, v, u: law(now, q, v, begun(now) * u))
    return t, begun(t) * sine.acceleration(t), moved


@pytest.mark.parametrize("cause", CAUSES)
def test_simulated_as_an_independent_integration_has_it(cause):
    t, reference, moved = record(cause, 1, 3.0)
    simulated = simulate(model(effect_of(cause)), reference, RATE, axis="x")
    without = simulate(model(), reference, RATE, axis="x")
    inside = slice(None, -30)  # the reference ends there
    assert np.std((simulated - moved)[inside]) < 1e-3 * np.std(moved)
    assert np.std((without - moved)[inside]) > 0.02 * np.std(moved)


@pytest.mark.parametrize("cause", CAUSES)
def test_corrector_gives_the_reference_however_the_stream_is_cut(cause):
    t, reference, moved = record(cause, 2, 4.0)
    made, results = samples(t, moved), []
    for cuts in ([0, len(t)], [0, 3, 500, 501, 1300, len(t)]):
        corrector = Corrector(model(effect_of(cause)), RATE, noise_std=1e-3,
                              bandwidth_hz=110.0)
        parts = [corrector.process(made.stamps_ns[a:b], made.values[a:b])
                 for a, b in zip(cuts, cuts[1:])]
        results.append([np.concatenate([part.values[:, 0] for part in parts]),
                        np.concatenate([part.index for part in parts])])
    assert all(np.array_equal(one, other) for one, other in zip(*results))
    corrected, index = results[0]
    error = (corrected - reference[index])[200:-200]
    linear = Corrector(model(), RATE, bandwidth_hz=110.0).process(made.stamps_ns, made.values)
    before = (linear.values[:, 0] - reference[linear.index])[200:-200]
    # of an impact, much lies above the Nyquist frequency, and what has folded cannot be undone
    assert np.std(error) < (0.6 if cause == "impact_stop" else 0.15) * np.std(before)


@pytest.mark.parametrize("cause", CAUSES)
def test_found_again_and_nothing_else(cause):
    t, reference, moved = record(cause, 3)
    rng = np.random.default_rng(3)
    values = moved + 2e-3 * rng.normal(size=len(t))
    found = diagnose((samples(t, reference), samples(t, values)), model(), "x")
    assert [finding.cause for finding in found.findings] == [effect_of(cause)["cause"]]
    for name, value in CAUSES[cause][0].items():
        if isinstance(value, str):
            assert getattr(found.findings[0].effect, name) == value
            continue
        assert abs(getattr(found.findings[0].effect, name) / value - 1) < 0.05


def test_drift_goes_on_after_a_gap():
    """The time counts from the record's start, not from where the stream begins anew."""
    t, reference, moved = record("stiffness_drift", 4)
    kept = (t < 2) | (t > 5)
    made = samples(t[kept], moved[kept])
    corrected = Corrector(model({"cause": "stiffness_drift", "rate_per_s": 0.02}), RATE,
                          bandwidth_hz=110.0).process(made.stamps_ns, made.values)
    late = t[kept][corrected.index] > 5.5
    error = corrected.values[late, 0] - reference[kept][corrected.index[late]]
    assert np.std(error[:-200]) < 0.02 * np.std(reference)


def test_hysteresis_whose_branches_bend_outwards():
    """beta + gamma < 0: z follows z' = q' (1 + k z); without a bound it is refused."""
    path = np.sin(np.linspace(0, 20, 4001))
    z, steps = 0.0, []
    for change in np.diff(path):
        z = follow_one_way(z, change, 0.5, -0.7)
        steps.append(z)
    y, fine = 0.0, []
    for change in np.diff(np.sin(np.linspace(0, 20, 400_001))):
        y += change - 0.5 * abs(change) * y + 0.7 * change * abs(y)
        fine.append(y)
    np.testing.assert_allclose(steps, fine[99::100], atol=1e-4)
    wild = {"cause": "hysteresis", "strength": -0.9, "beta": 0.0, "gamma": -40.0}
    t = times(2.0)
    with pytest.raises(FracAccelError, match="without bound"):
        simulate(model(wild), 5 * np.sin(40 * t), RATE, axis="x")
    spike = samples(t, np.where(np.arange(len(t)) == 500, 1e4, np.sin(40 * t)))
    corrected = Corrector(model(wild), RATE, bandwidth_hz=100.0).process(
        spike.stamps_ns, spike.values)
    assert np.isfinite(corrected.values).all()


@pytest.mark.parametrize("parameters, words", [({"gap": 0.0, "stiffness": 2.0}, "gap"),
                                               ({"gap": 1.0, "stiffness": 0.0}, "stiffness"),
                                               ({"gap": 1.0, "stiffness": 1.0, "sides": 1.5},
                                                "sides")])
def test_a_stop_that_cannot_be_is_refused(parameters, words):
    with pytest.raises(FracAccelError, match=words):
        model({"cause": "impact_stop", **parameters})
