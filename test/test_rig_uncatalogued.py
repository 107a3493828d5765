"""Effects outside the catalogue are simulated as accurately as those in it."""

import numpy as np
import pytest
import rig
from rig.oscillator import integrate
from scipy.integrate import solve_ivp

pytestmark = pytest.mark.long

REQUIRED = 5e-4  # of the signal's RMS, both as in test_rig_accuracy.py
MEASURED = 2e-5


def relative_rms(error, signal):
    return np.sqrt(np.mean(np.square(error)) / np.mean(np.square(signal)))


def drawn(seed):
    """Random classical sensor and bursts for it."""
    rng = np.random.default_rng(seed)
    sensor = rig.draw_sensor(rng, 2000.0)
    excitation = rig.noise_bursts(rng, 2000.0, 2.0, (10, 500), [1, 3, 2], (1, 0, 0))
    return rng, sensor, excitation


@pytest.mark.parametrize("stop", [(-np.inf, 0.6, 100.0), (-0.4, 0.5, 30.0), (-0.3, np.inf, 300.0)])
def test_stop_against_an_adaptive_solver(stop):
    """The solver halts at every contact, so that it never steps over the kink."""
    w, ratio = 2 * np.pi * 20.0, 0.1

    def base(t):
        return 2 * np.tanh(20 * t) ** 6 * np.sin(2 * np.pi * 13.0 * t)

    def right_side(t, x, spring, place):
        return [x[1], w ** 2 * (base(t) - x[0] - spring * (x[0] - place)) - 2 * ratio * w * x[1]]

    t = np.arange(12801) / 25600
    adaptive, now, state = np.zeros(len(t)), 0.0, np.zeros(2)
    spring, place, contacts = 0.0, 0.0, 0
    while now < t[-1]:
        crossings = [lambda t, x, *_, place=place: x[0] - place
                     for place in stop[:2] if np.isfinite(place)]
        for crossing in crossings:
            crossing.terminal = True
        piece = solve_ivp(right_side, (now, t[-1]), state, "DOP853", dense_output=True,
                          events=crossings, rtol=1e-10, atol=1e-12, max_step=1e-3,
                          args=(spring, place))
        inside = (t >= now) & (t <= piece.t[-1])
        adaptive[inside] = piece.sol(t[inside])[0]
        now, state = piece.t[-1], piece.y[:, -1]
        if now < t[-1]:
            hit = next(i for i, times in enumerate(piece.t_events) if len(times))
            place = [p for p in stop[:2] if np.isfinite(p)][hit]
            outward = state[1] * (1 if place == stop[1] else -1) > 0
            spring = stop[2] if outward else 0.0
            # a hair beyond the place, or it would be found again
            state = state + 1e-10 * np.array(right_side(now, state, spring, place))
            now += 1e-10
            contacts += 1
    assert contacts > 10
    q = integrate(base(t), t[1], 20.0, ratio, stop=stop).q
    assert relative_rms(q - adaptive, adaptive) < MEASURED


@pytest.mark.parametrize("seed", range(4))
def test_stop_converges_for_random_sensors(seed):
    """The stop of a lightly damped sensor makes every error grow from impact to impact."""
    rng, sensor, _ = drawn(seed)
    core = sensor.core
    excitation = rig.noise_bursts(rng, 2000.0, 1.0, (10, 500), [1, 2], oversampling=256)
    finest = core["sensitivity"] * excitation.acceleration[0]

    def solve(coarser, **kwargs):
        return integrate(finest[::coarser], coarser * excitation.step_s,
                         core["natural_frequency_hz"], core["damping_ratio"],
                         **kwargs).q[::64 // coarser]

    free = solve(4)
    stop = (-3 * free.std(), 1.5 * free.std(), 10 ** rng.uniform(1, 2))
    q64, q256 = solve(4, stop=stop), solve(1, stop=stop)
    assert relative_rms(q64 - free, q64) > 1e-2
    assert relative_rms(q64 - q256, q256) < REQUIRED


@pytest.mark.parametrize("seed", range(4))
def test_gain_modulation_is_a_factor_on_the_exact_output(seed):
    rng, sensor, excitation = drawn(seed)
    depth, frequency, phase = rng.uniform(0.01, 0.3), rng.uniform(1, 20), rng.uniform(0, 2 * np.pi)
    sensor.effects["gain_modulation"] = {"depth": depth, "frequency_hz": frequency,
                                         "phase_rad": phase}
    t = np.arange(excitation.samples) / 2000.0
    exact = rig.exact_output(rig.Sensor(sensor.core), "x", excitation)
    exact = exact * (1 + depth * np.sin(2 * np.pi * frequency * t + phase))
    error = rig.simulate_record(sensor, excitation).sensor[:, 0] - exact
    assert relative_rms(error, exact) < MEASURED


@pytest.mark.parametrize("seed", range(4))
def test_moving_delay_reads_the_steady_sine_at_the_moved_instants(seed):
    rng, sensor, _ = drawn(seed)
    amplitude, phase = rng.uniform(0.1, 2) / 2000.0, rng.uniform(0, 2 * np.pi)
    sensor.effects["moving_delay"] = {"amplitude_s": amplitude, "frequency_hz": 3.0,
                                      "phase_rad": phase}
    excited_hz = rng.uniform(50, 600)
    excitation = rig.sines(2000.0, 4.0, [excited_hz], [0.3], (1, 0, 0), lead_s=4.0)
    t = np.arange(excitation.samples) / 2000.0
    response = rig.transfer_function(rig.Sensor(sensor.core), "x", 2j * np.pi * excited_hz)
    moved = t - amplitude * np.sin(6 * np.pi * t + phase)
    exact = np.imag(response * np.exp(1j * (2 * np.pi * excited_hz * moved + 0.3)))
    late = t > 2
    error = rig.simulate_record(sensor, excitation).sensor[:, 0] - exact
    assert relative_rms(error[late], exact[late]) < MEASURED
