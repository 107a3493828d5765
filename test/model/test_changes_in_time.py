"""What changes in the middle of a record, or slowly along it: simulated, undone, found again."""

import numpy as np
import pytest
from second_set_bench import RATE, Multisine, model, samples, times

from frac_accel import Corrector, simulate
from frac_accel.diagnosis import diagnose

N = 8000
TEMPERATURE = 20 + 15 * np.sin(np.linspace(0, 7, N))
# By cause (and what is special): parameters, and what it makes of the motion q at the instants t.
CAUSES = {
    "offset_drift": ({"rate_per_s": -0.02}, lambda t, q: q - 0.02 * t),
    "warm_up_drift": ({"size": 0.3, "time_constant_s": 4.0},
                lambda t, q: q + 0.3 * (1 - np.exp(-t / 4.0))),
    "warm_up_drift to zero": (
        {"size": 0.3, "time_constant_s": 4.0, "settles_at": "zero"},
        lambda t, q: q + 0.3 * np.exp(-t / 4.0)),
    "thermal_offset": ({"coefficient_per_k": 0.004}, lambda t, q: q + 0.004 * (TEMPERATURE - 25)),
    "offset_step": ({"at_s": 3.0011, "step": 0.04}, lambda t, q: q + 0.04 * (t >= 3.0011)),
    "time_step": ({"at_s": 6.0011, "step_s": 0.003}, None),
    "gain_step": ({"at_s": 5.0011, "ratio": 0.95}, lambda t, q: q * np.where(t < 5.0011, 1, 0.95)),
}


def effect_of(case):
    return {"cause": case.split()[0], **CAUSES[case][0]}


def record(cause, seed, noise=0.01):
    rng = np.random.default_rng(seed)
    t, sine = times(N / RATE), Multisine(rng)
    if cause == "time_step":
        values = sine.motion(np.where(t < 6.0011, t, t - 0.003))
    else:
        values = CAUSES[cause][1](t, sine.motion(t))
    return t, sine.acceleration(t), values + noise * rng.normal(size=N)


@pytest.mark.parametrize("cause", CAUSES)
def test_simulated_as_it_was_made(cause):
    made = CAUSES[cause][1]
    t, reference, _ = record(cause, 1)
    if cause == "time_step":
        made_of = simulate(model(effect_of(cause)), reference, RATE, axis="x")
        inside = slice(500, -100)  # the motion from before the record has died away
        expected = record(cause, 1, noise=0.0)[2]
        assert np.std((made_of - expected)[inside]) < 1e-3 * np.std(expected)
        return
    both = [simulate(model(*effects), reference, RATE, axis="x", temperature_c=TEMPERATURE)
            for effects in ([], [effect_of(cause)])]
    np.testing.assert_allclose(both[1], made(t, both[0]), atol=1e-12)


@pytest.mark.parametrize("cause", CAUSES)
def test_corrector_takes_it_out_however_the_stream_is_cut(cause):
    t, reference, values = record(cause, 2, noise=0.0)
    made = samples(t, values)
    results = []
    for cuts in ([0, N], [0, 1, 7, 1500, 1501, 2600, N]):
        corrector = Corrector(model(effect_of(cause)), RATE, noise_std=0.01)
        parts = []
        for start in range(0, N, 100):
            corrector.set_temperature(TEMPERATURE[start:start + 100].mean())
            inner = [start, *(c for c in cuts if start < c < start + 100), start + 100]
            parts += [corrector.process(made.stamps_ns[a:b], made.values[a:b])
                      for a, b in zip(inner, inner[1:])]
        results.append(tuple(np.concatenate([getattr(p, name)for p in parts])
                             for name in ("index", "stamps_ns", "values", "variance")))
    index, stamps, corrected, variance = results[0]
    assert all(np.array_equal(one, other) for one, other in zip(*results))
    inside = slice(300, -300)
    if cause == "time_step":
        after = t[index] > 6.1
        assert set(stamps[~after & (t[index] < 6)] - made.stamps_ns[index][~after & (t[index] < 6)]
                   ) == {0}
        assert set(stamps[after] - made.stamps_ns[index][after]) == {-3_000_000}
        assert (np.diff(stamps) > 0).all()
        # in which the filter sees both sides of the jump
        near = np.abs(t[index] - 6.0) < 0.3
        moved = 1e-9 * (stamps - made.stamps_ns[0])
        error = np.where(near, 0.0, corrected[:, 0] - Multisine(
            np.random.default_rng(2)).acceleration(moved))[inside]
    else:
        error = corrected[inside, 0] - reference[index][inside]
    assert np.std(error) < 0.02 * np.std(reference)
    assert (variance > 0).all()


@pytest.mark.parametrize("cause", CAUSES)
@pytest.mark.parametrize("seed", (3, 4))
def test_found_again_and_nothing_else(cause, seed):
    t, reference, values = record(cause, seed)
    found = diagnose((samples(t, reference), samples(t, values)), model(), "x",
                     (samples(t, t).stamps_ns, TEMPERATURE))
    assert [finding.cause for finding in found.findings] == [effect_of(cause)["cause"]]
    finding = found.findings[0]
    for name, value in CAUSES[cause][0].items():
        if isinstance(value, str):
            assert getattr(finding.effect, name) == value
            continue
        assert abs(getattr(finding.effect, name) - value) < 4 * finding.std[name]
        assert finding.std[name] < 0.1 * abs(value)


@pytest.mark.parametrize("seed", range(6, 8))
@pytest.mark.parametrize(("cause", "begin", "names"), [
    ("offset_drift", 0, ["offset_drift"]), ("offset_drift", 2000, ["offset", "offset_drift"]),
    ("offset_step", 1000, ["offset_step"])])
def test_found_in_a_short_record_whose_residual_is_nearly_all_slow(cause, begin, names, seed):
    t, reference, values = record(cause, seed)
    part = slice(begin, begin + int(np.random.default_rng(seed).integers(2000, 3000)))
    found = diagnose((samples(t[part], reference[part]), samples(t[part], values[part])), model())
    assert found.verdict == "explained"
    assert [finding.cause for finding in found.findings] == names


def test_a_record_without_a_change_shows_none():
    t, reference, values = record("offset_drift", 5)
    values = values + 0.02 * t
    found = diagnose((samples(t, reference), samples(t, values)), model(), "x")
    assert found.verdict == "consistent" and not found.findings


@pytest.mark.parametrize("ratio", [0.0, -1.0])
def test_a_gain_that_cannot_be_inverted_is_refused(ratio):
    with pytest.raises(Exception, match="ratio"):
        model({"cause": "gain_step", "at_s": 1.0, "ratio": ratio})
