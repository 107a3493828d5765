"""Effects outside the catalogue are simulated as accurately as those in it."""

import numpy as np
import pytest
import rig
from rig.hidden import draw_case
from rig.oscillator import integrate
from rig.unknown import felt_motion
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


RATE = 1000.0


def flat(**effects):
    return rig.Sensor({"type": "gain", "sensitivity": 1.0}, effects)


def noise(amplitude=1.0):
    return rig.band_noise(np.random.default_rng(0), RATE, 4.0, (2, 300), amplitude)


def steady_sine(frequency_hz, amplitude=1.0):
    """Sine with phase 0.3 at the record's start, long after its ramp, and the record's times."""
    excitation = rig.sines(RATE, 3.0, [frequency_hz], [0.3], amplitude, lead_s=2.0)
    return excitation, np.arange(excitation.samples) / RATE


def test_two_mounts_against_their_product():
    _, sensor, excitation = drawn(1)
    sensor.effects["two_mounts"] = {"first_hz": 310.0, "second_hz": 190.0, "damping_ratio": 0.05}
    exact = rig.exact_output(sensor, "x", excitation)
    assert relative_rms(rig.simulate_record(sensor, excitation).sensor[:, 0] - exact,
                        exact) < MEASURED


def test_duffing_mount_against_an_adaptive_solver():
    w, ratio, cubic = 2 * np.pi * 20.0, 0.1, 0.05

    def base(t):
        return 2 * np.tanh(20 * t) ** 6 * np.sin(2 * np.pi * 13.0 * t)

    def right_side(t, x):
        return [x[1], w ** 2 * (base(t) - x[0] - cubic * x[0] ** 3) - 2 * ratio * w * x[1]]

    t = np.arange(12801) / 25600
    q, v = solve_ivp(right_side, (0, t[-1]), [0.0, 0.0], "DOP853", t[::64], rtol=1e-10,
                     atol=1e-12, max_step=1e-3).y
    exact = q + cubic * q ** 3 + 2 * ratio / w * v
    felt = felt_motion({"duffing_mount": {"frequency_hz": 20.0, "damping_ratio": ratio,
                                          "cubic": cubic}}, base(t), t[1], 0)
    assert relative_rms(felt[::64] - exact, exact) < 1e-6


def test_lever_arm_adds_band_noise_that_the_reference_lacks():
    excitation = noise()
    arm = {"rms": 0.3, "low_hz": 10.0, "high_hz": 50.0, "seed": 4}
    record = rig.simulate_record(flat(lever_arm=arm), excitation)
    added = record.sensor - record.reference
    power = np.abs(np.fft.rfft(added * np.hanning(len(added))[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(added), 1 / RATE)
    inside = (frequency > 9) & (frequency < 51)
    assert power[inside].sum() > 0.999 * power.sum()
    assert np.allclose(added.std(axis=0), 0.3, rtol=0.15)
    assert np.max(np.abs(np.corrcoef(added.T, record.reference.T) - np.eye(6))[:3]) < 0.15
    assert np.array_equal(record.sensor, rig.simulate_record(flat(lever_arm=arm),
                                                             excitation).sensor)


def test_slew_limit_makes_a_triangle_of_a_steep_sine():
    excitation, t = steady_sine(10.0, 5.0)
    x = rig.simulate_record(flat(slew_limit={"most_per_s": 40.0}), excitation).sensor[:, 0]
    steps = np.diff(x) * RATE
    assert np.max(np.abs(steps)) < 40.0 * (1 + 1e-6)
    assert np.mean(np.abs(steps) > 39.99) > 0.97  # it turns twice a period
    assert abs(np.ptp(x[1000:]) / 2.0 - 1) < 0.02  # 40 /s for half a period
    free = rig.simulate_record(flat(slew_limit={"most_per_s": 400.0}), excitation).sensor[:, 0]
    assert relative_rms(free - 5 * np.sin(20 * np.pi * t + 0.3), free) < 1e-6


def test_rectification_with_memory_in_its_closed_form():
    excitation, t = steady_sine(30.0, 2.0)
    own = {"strength": 0.1, "corner_hz": 5.0}
    x = rig.simulate_record(flat(rectification_memory=own), excitation).sensor[:, 0]
    low_pass = 1 / (1 + 1j * 60.0 / 5.0)
    double = np.real(low_pass * np.exp(2j * (2 * np.pi * 30.0 * t + 0.3)))
    exact = 2 * np.sin(2 * np.pi * 30.0 * t + 0.3) + 0.1 * 2.0 * (1 - double)
    assert relative_rms(x - exact, exact) < MEASURED


def test_resampling_reads_the_nearest_of_another_sampler():
    excitation, t = steady_sine(30.0)
    x = rig.simulate_record(flat(resampling_glitches={"rate_hz": 1234.5}), excitation)
    exact = np.sin(2 * np.pi * 30.0 * np.round(t * 1234.5) / 1234.5 + 0.3)
    assert relative_rms(x.sensor[:, 0] - exact, exact) < 1e-8
    assert relative_rms(x.reference[:, 0] - exact, exact) > 0.02


def test_cross_talk_is_the_next_axis_of_a_while_ago():
    excitation, t = steady_sine(30.0, (1.0, 2.0, 0.0))
    own = {"coefficient": 0.2, "delay_s": 7.3e-3}
    x = rig.simulate_record(flat(delayed_cross_talk=own), excitation).sensor
    exact = (np.sin(2 * np.pi * 30.0 * t + 0.3)
             + 0.4 * np.sin(2 * np.pi * 30.0 * (t - 7.3e-3) + 0.3))
    assert relative_rms(x[:, 0] - exact, exact) < 1e-6
    assert np.allclose(x[:, 2], 0.2 * np.sin(2 * np.pi * 30.0 * (t - 7.3e-3) + 0.3), atol=1e-6)


STATIC = {
    "tanh_saturation": ({"limit": 1.5}, lambda a: 1.5 * np.tanh(a / 1.5)),
    "asymmetric_gain": ({"ratio": 0.8}, lambda a: np.where(a < 0, 0.8 * a, a)),
    "gain_by_axis": ({"depth": 0.1}, lambda a: a * (1 + 0.1 * np.roll(
        (a - a.mean(axis=0)) / a.std(axis=0), -1, axis=1))),
}


@pytest.mark.parametrize("kind", STATIC)
def test_static_kinds(kind):
    own, expected = STATIC[kind]
    record = rig.simulate_record(flat(**{kind: own}), noise((1.0, 2.0, 0.5)))
    assert np.allclose(record.sensor, expected(record.reference), atol=1e-12)


def test_random_kinds_have_their_level_and_come_again():
    excitation = rig.band_noise(np.random.default_rng(0), RATE, 4.0, (2, 300), lead_s=1.0)
    a = excitation.reference[:, 0]

    def of(**effects):
        first, second = (rig.simulate_record(flat(**effects), excitation).sensor[:, 0]
                         for _ in range(2))
        assert np.array_equal(first, second)
        return first

    factor = of(multiplicative_noise={"depth": 0.1, "seed": 2}) / a - 1
    assert abs(factor.std() / 0.1 - 1) < 0.05
    factor = of(loose_contact={"share": 0.1, "gain": 0.4, "seed": 2}) / a
    loose = np.abs(factor - 0.4) < 1e-9
    assert 0.1 <= loose.mean() < 0.12 and np.allclose(factor[~loose], 1.0)
    walk = of(wandering_offset={"rms": 0.5, "seed": 3}) - a
    assert abs(walk.std() - 0.5) < 1e-9 and np.abs(np.diff(walk)).max() < 0.2
    held = of(held_values={"share": 0.2, "seed": 3})
    same = np.append(False, held[1:] == held[:-1])
    assert 0.2 <= same.mean() < 0.22 and np.allclose(held[~same], a[~same], atol=1e-12)


def test_tones_appear_folded_and_wander():
    tones = {"amplitude": 0.2, "rates_hz": [900.0], "seed": 6}
    excitation = rig.band_noise(np.random.default_rng(0), RATE, 20.0, (2, 300))
    record = rig.simulate_record(flat(folded_tones=tones), excitation)
    added = (record.sensor - record.reference)[:, 0]
    assert abs(added.std() - 0.2 / np.sqrt(2)) < 0.01
    power = np.abs(np.fft.rfft(added)) ** 2
    frequency = np.fft.rfftfreq(len(added), 1 / RATE)
    near = np.abs(frequency - 100.0) < 90  # 3 % of 900 Hz, three standard deviations
    assert power[near].sum() > 0.95 * power.sum()
    assert power.max() < 0.5 * power.sum()  # no single line


def test_batches_are_stamped_on_arrival():
    record = rig.simulate_record(flat(batched_stamps={"count": 5}), noise())
    late = (record.sensor_stamps_ns - record.stamps_ns) * 1e-9
    assert np.all(np.diff(record.sensor_stamps_ns) > 0)
    assert np.allclose(late[:5], [3.6e-3, 2.7e-3, 1.8e-3, 0.9e-3, 0.0], atol=1e-8)
    assert np.allclose(record.sensor, record.reference, atol=1e-12)


def test_a_fault_may_begin_in_mid_record():
    excitation = noise()
    own = {"limit": 0.5, "begins_s": 1.7}
    record = rig.simulate_record(flat(tanh_saturation=own), excitation)
    before = np.arange(excitation.samples) / RATE < 1.7
    assert np.allclose(record.sensor[before], record.reference[before], atol=1e-12)
    assert np.allclose(record.sensor[~before], 0.5 * np.tanh(record.reference[~before] / 0.5),
                       atol=1e-12)


def test_a_wrong_model_is_wrong_and_its_sensor_right():
    case = draw_case(5, {"wrong_model"}, kind="lab")
    assert len(case.baseline.effects) == 1
    bare = rig.Sensor(case.sensor.core)
    assert case.sensor.to_model() == bare.to_model() != case.baseline.to_model()


def test_there_are_more_than_a_dozen_kinds_and_none_is_a_cause():
    assert len(set(rig.UNCATALOGUED)) >= 18
    assert not set(rig.UNCATALOGUED) & {*rig.CAUSES, *rig.SECOND_SET}
