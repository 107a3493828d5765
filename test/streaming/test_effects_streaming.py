"""With every effect in the model, too, the output does not depend on how a stream is split."""

import numpy as np
import pytest
import rig
from random_models import model_of
from test_streaming_identity import eventful_stream, invariant, same, split

from frac_accel import Corrector, LiveSimulator

RATE = 1000.0
LENGTH = 1200
EVERYTHING = tuple(cause for cause in rig.CAUSES if cause != "fractional_damping")
NOT_LIVE = ("quadratic_stiffness", "cubic_stiffness", "hysteresis", "coulomb_friction")


def run(kernel, stream, edges, temperatures):
    """Output of all blocks; temperatures come before the samples with these numbers."""
    cuts = np.unique(np.r_[edges, list(temperatures)])
    parts = []
    for start, stop in zip(cuts[:-1], cuts[1:]):
        if start in temperatures:
            kernel.set_temperature(temperatures[start])
        parts.append(kernel.process(*(column[start:stop] for column in stream)))
    parts.append(kernel.finish())
    return tuple(np.concatenate([getattr(part, name) for part in parts])
                 for name in ("index", "stamps_ns", "values", "variance"))


@pytest.mark.parametrize("kernel", [Corrector, LiveSimulator])
@pytest.mark.parametrize("seed", range(3))
def test_any_split_is_bit_identical(seed, kernel):
    rng = np.random.default_rng([9, seed])
    kind = ("classical", "fractional")[seed % 2]
    causes = [cause for cause in EVERYTHING if kernel is Corrector or cause not in NOT_LIVE]
    model = model_of(rig.draw_sensor(rng, RATE, kind, causes, natural_frequency=(0.1, 0.3),
                                     damping_ratio=(0.1, 0.7)))
    stream = eventful_stream(rng, LENGTH)
    temperatures = {100: 20.0, 500: 31.0, 501: 31.5, 900: -4.0}
    rate = RATE if seed else 0.0
    noise = 0.05 if seed != 1 else None
    whole_kernel = kernel(model, rate, noise_std=noise)
    whole = run(whole_kernel, stream, [0, LENGTH], temperatures)
    assert len(whole[0]) > 100
    assert np.isfinite(whole[2]).all()
    assert invariant(whole_kernel.counters)
    for kind_of_split in ("one by one", "fixed", "random"):
        other = kernel(model, rate, noise_std=noise)
        parts = run(other, stream, split(rng, LENGTH, kind_of_split), temperatures)
        assert same(whole, parts), kind_of_split
        assert other.counters == whole_kernel.counters


def test_new_model_starts_with_the_samples_and_temperatures_that_were_there():
    rng = np.random.default_rng(10)
    old, new = (model_of(rig.draw_sensor(rng, RATE, "classical", [
        "cubic_stiffness", "temperature_sensitivity", "gain_drift", "tone_interference"],
        natural_frequency=(0.1, 0.3), damping_ratio=(0.1, 0.7))) for _ in range(2))
    stamps = 10**12 + np.arange(2000) * 1_000_000
    values = rng.normal(size=(2000, 3))

    def corrected(kernel, change=None):
        parts = []
        for start in range(0, 2000, 500):
            kernel.set_temperature(20.0 + start / 100)
            if start == change:
                parts.append(kernel.replace(new))
            parts.append(kernel.process(stamps[start:start + 500], values[start:start + 500]))
        return parts

    exchanged = corrected(Corrector(old, RATE), change=1000)
    index = np.concatenate([part.index for part in exchanged])
    assert (np.diff(index) == 1).all()
    always = corrected(Corrector(new, RATE))
    after = exchanged[-1]
    expected = np.concatenate([part.values for part in always])[-len(after):]
    np.testing.assert_allclose(after.values, expected, rtol=1e-9, atol=1e-9)
