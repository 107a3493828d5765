"""The cores' frequency responses and stability against formulas written out independently."""

import cmath

import numpy as np
import pytest

from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model.core import Arx, FractionalTransferFunction, Oscillator
from frac_accel.model.core.principal_sheet import count_right_half_plane_zeros


def response(core, frequency_hz, effects=()):
    return SensorModel(core, effects).frequency_response(frequency_hz)


@pytest.mark.parametrize("seed", range(10))
def test_oscillator_by_polar_form(seed):
    """(j w)**v = w**v (cos v pi/2 + j sin v pi/2), each part by real arithmetic."""
    rng = np.random.default_rng(seed)
    f0, zeta = 10 ** rng.uniform(0, 4), 10 ** rng.uniform(-2, 0.3)
    order, gain = rng.uniform(0.1, 1.9), rng.uniform(-3, 3)
    core = Oscillator(f0, zeta, order, gain)
    for f in f0 * 10 ** rng.uniform(-3, 1.5, 20):
        x = f / f0
        real = 1 - x**2 + 2 * zeta * x**order * np.cos(order * np.pi / 2)
        imaginary = 2 * zeta * x**order * np.sin(order * np.pi / 2)
        expected = gain * complex(real, -imaginary) / (real**2 + imaginary**2)
        assert abs(response(core, f) / expected - 1) < 1e-12


def test_classical_oscillator_textbook_values():
    core = Oscillator(100.0, 0.05, 1.0, 2.0)
    assert response(core, 100.0) == pytest.approx(2.0 / (2j * 0.05), rel=1e-12)
    peak = 100 * np.sqrt(1 - 2 * 0.05**2)
    assert abs(response(core, peak)) == pytest.approx(2 / (2 * 0.05 * np.sqrt(1 - 0.05**2)))
    assert response(core, 1e-6) == pytest.approx(2.0)


def test_order_one_is_the_limit_of_its_neighbours():
    frequency = np.geomspace(0.1, 1e4, 100)
    one = response(Oscillator(100.0, 0.2, 1.0), frequency)
    for order in (1 - 1e-9, 1 + 1e-9):
        np.testing.assert_allclose(response(Oscillator(100.0, 0.2, order), frequency), one,
                                   rtol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_equation_5_with_the_oscillators_orders_is_the_oscillator(seed):
    rng = np.random.default_rng(seed)
    f0, zeta, order = 10 ** rng.uniform(0, 4), rng.uniform(0.01, 1), rng.uniform(0.2, 1.8)
    w = 2 * np.pi * f0
    general = FractionalTransferFunction((w**-2, 2 * zeta * w**-order, 1.0), (2.0, order, 0.0),
                                         (1.7,), (0.0,))
    frequency = f0 * np.geomspace(1e-3, 30, 200)
    np.testing.assert_allclose(response(general, frequency),
                               response(Oscillator(f0, zeta, order, 1.7), frequency), rtol=1e-11)
    np.testing.assert_allclose(np.sort_complex(general.poles()),
                               np.sort_complex(Oscillator(f0, zeta, order).poles()), rtol=1e-7)


def test_arx_is_the_difference_equation():
    """Its steady answer to a sine, by running the recursion."""
    core = Arx((0.3, 0.1, -0.05), (1.0, -1.2, 0.6), 1000.0)
    n = np.arange(3000)
    z = cmath.exp(2j * np.pi * 0.123)
    x = (z ** n)
    y = np.zeros(3000, complex)
    for k in range(2, 3000):
        y[k] = (0.3 * x[k] + 0.1 * x[k - 1] - 0.05 * x[k - 2] + 1.2 * y[k - 1] - 0.6 * y[k - 2])
    assert abs(y[-1] / x[-1] / response(core, 123.0) - 1) < 1e-10
    assert response(core, 1123.0) == pytest.approx(response(core, 123.0))


@pytest.mark.parametrize("data, formula", [
    ({"cause": "ac_coupling", "corner_hz": 3.0}, lambda f: 1j * f / (1j * f + 3)),
    ({"cause": "low_pass_lag", "corner_hz": 70.0}, lambda f: 1 / (1 + 1j * f / 70)),
    ({"cause": "mounting_resonance", "frequency_hz": 40.0, "damping_ratio": 0.1},
     lambda f: (1 + 0.2j * f / 40) / (1 - (f / 40)**2 + 0.2j * f / 40)),
    ({"cause": "time_delay", "delay_s": 0.002}, lambda f: np.exp(-2j * np.pi * f * 0.002)),
    ({"cause": "sensitivity_error", "gain": -0.9}, lambda f: -0.9 + 0 * f),
    ({"cause": "offset", "offset": 5.0}, lambda f: 1 + 0 * f),
])
def test_links(data, formula):
    core = {"natural_frequency_hz": 100.0, "damping_ratio": 0.2, "damping_order": 1.3}
    build = {"schema": "frac_accel/sensor_model/1", "core": core}
    frequency = np.geomspace(0.01, 400, 100)
    ratio = (SensorModel.from_dict({**build, "effects": [data]}).frequency_response(frequency)
             / SensorModel.from_dict(build).frequency_response(frequency))
    np.testing.assert_allclose(ratio, formula(frequency), rtol=1e-11)


def test_fractional_damping_replaces_the_cores():
    model = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 100.0, "damping_ratio": 0.2, "sensitivity": 3.0},
        "effects": [{"cause": "fractional_damping", "damping_order": 0.7, "damping_ratio": 0.4}]})
    frequency = np.geomspace(0.1, 400, 50)
    np.testing.assert_allclose(model.frequency_response(frequency),
                               response(Oscillator(100.0, 0.4, 0.7, 3.0), frequency), rtol=1e-13)


@pytest.mark.parametrize("seed", range(60))
def test_argument_principle_counts_what_the_roots_say(seed):
    """Integer orders, where the polynomial's roots are known otherwise."""
    rng = np.random.default_rng(seed)
    degree = int(rng.integers(1, 6))
    real = rng.normal(size=degree % 2)
    pairs = rng.normal(size=(degree // 2, 2)) @ [1, 1j]
    roots = np.r_[real, pairs, pairs.conj()] * 10 ** rng.uniform(-2, 4)
    coefficients = np.poly(roots).real
    assert np.min(np.abs(roots.real) / np.abs(roots)) > 1e-4
    count = count_right_half_plane_zeros(coefficients, np.arange(degree, -1, -1.0))
    assert count == pytest.approx(np.sum(roots.real > 0), abs=1e-3)


@pytest.mark.parametrize("seed", range(30))
def test_stability_of_commensurate_orders_by_matignon(seed):
    """Orders k / 2: stable where every root in sqrt(s) has an argument above pi / 4."""
    rng = np.random.default_rng(1000 + seed)
    coefficients = rng.normal(size=int(rng.integers(2, 6)))
    orders = np.arange(len(coefficients) - 1, -1, -1.0) / 2
    roots = np.roots(coefficients)
    margin = np.abs(np.angle(roots)) - np.pi / 4
    assert np.min(np.abs(margin)) > 1e-4
    core = FractionalTransferFunction(tuple(coefficients), tuple(orders), (1.0,), (0.0,))
    if np.all(margin > 0):
        core.require_stable("core")
    else:
        with pytest.raises(ModelError, match="unstable"):
            core.require_stable("core")


@pytest.mark.parametrize("order", [0.3, 0.9, 1.0, 1.1, 1.7, 1.95])
def test_poles_solve_the_characteristic_equation_and_are_stable(order):
    core = Oscillator(50.0, 0.1, order)
    poles = core.poles()
    assert len(poles) == 2 and np.all(poles.real < 0)
    u = poles / (2 * np.pi * 50)
    assert np.max(np.abs(u**2 + 0.2 * u**order + 1)) < 1e-9


def test_a_pole_on_the_axis_is_not_stable():
    undamped = FractionalTransferFunction((1.0, 1.0), (2.0, 0.0), (1.0,), (0.0,))
    with pytest.raises(ModelError, match="unstable"):
        undamped.require_stable("core")
