"""Every cause that is fitted says where its fit begins."""

from types import SimpleNamespace

import numpy as np
import pytest
from rig.hidden import draw_case
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt
from searched import searched

from frac_accel.model.effects import known_effects
from frac_accel.model.effects.fit_starts import drifting_lags


@pytest.fixture(scope="module")
def view():
    case = draw_case(7, ["temperature_sensitivity"])
    _, engine, _ = searched(case)
    return engine.search.view(engine.search.fit(engine.search.base))


# What that record does not show: the mass reaches no stop, and one axis moves. They are found again
# in test_further_forces and test_misalignment.
NOT_SHOWN = ("impact_stop", "misalignment")


@pytest.mark.parametrize(
    "cause", [cause for cause, effect in known_effects().items() if not effect.read_off])
def test_a_fit_of_every_cause_begins_somewhere(view, cause):
    starts = known_effects()[cause].starts(view)
    assert starts or cause in NOT_SHOWN
    assert all(start.effect.cause == cause for start in starts)


@pytest.mark.parametrize("seed", range(4))
def test_a_lag_that_grows_is_found_where_one_stretch_alone_is_misled(seed):
    # narrow-band motion agrees nearly as well a period away
    rng = np.random.default_rng(seed)
    rate, count = 100.0, 20_000
    t = np.arange(count) / rate
    growth, lag_s = rng.choice([-1, 1]) * rng.uniform(1e-4, 4e-4), rng.choice([0.0, 0.05])
    motion = sosfilt(butter(2, [9, 14], "band", fs=rate, output="sos"), rng.normal(size=count))
    measured = CubicSpline(t, motion)(np.clip(t - lag_s - growth * t, 0, t[-1]))
    used = np.ones(count, bool)
    view = SimpleNamespace(rate=rate, simulated=motion, used=used,
                           measured=measured + rng.normal(0, 0.2 * motion.std(), count))
    alone, found = drifting_lags(view)
    assert abs(found[0] - growth) * t[-1] < 0.01 and abs(found[1] - lag_s) < 0.01
    assert lag_s or abs(alone[0] - growth) * t[-1] < 0.01
