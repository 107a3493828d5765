"""A turned sensor: REP 103, told from a cross-axis sensitivity by what all axes say."""

import numpy as np
import pytest
from scipy.signal import butter, hilbert, sosfiltfilt
from scipy.spatial.transform import Rotation
from second_set_bench import RATE, Multisine, model, samples, times

from frac_accel import Corrector, SensorModel, simulate
from frac_accel.diagnosis import diagnose
from frac_accel.model.effects.misalignment import Misalignment

N = 8000


def motion(seed):
    rng = np.random.default_rng(seed)
    sines = [Multisine(rng) for _ in range(3)]
    t = times(N / RATE)
    return (rng, t, np.stack([sine.acceleration(t) for sine in sines], axis=1),
            np.stack([sine.motion(t) for sine in sines], axis=1))


def turned(values, roll, pitch, yaw):
    """Components in the axes of a body turned about the fixed x, then y, then z."""
    return Rotation.from_euler("xyz", [roll, pitch, yaw], degrees=True).inv().apply(values)


def found(t, reference, values, axis="x"):
    return diagnose((samples(t, reference), samples(t, values)), model(), axis)


@pytest.mark.parametrize("angles", [(3.0, -4.0, 5.0), (90.0, 0.0, 0.0), (20.0, 50.0, -160.0)])
def test_simulated_as_scipy_turns_it_and_turned_back(angles):
    _, t, reference, _ = motion(1)
    names = ("roll_deg", "pitch_deg", "yaw_deg")
    turn = {"cause": "misalignment", **dict(zip(names, angles))}
    np.testing.assert_allclose(simulate(model(turn), reference, RATE),
                               simulate(model(), turned(reference, *angles), RATE), atol=1e-9)
    made = samples(t, simulate(model(turn), reference, RATE))
    parts = [Corrector(model(turn), RATE, noise_std=0.01) for _ in range(2)]
    whole = parts[0].process(made.stamps_ns, made.values)
    cut = [parts[1].process(made.stamps_ns[a:b], made.values[a:b])
           for a, b in ((0, 1), (1, 2500), (2500, N))]
    assert np.array_equal(whole.values, np.concatenate([part.values for part in cut]))
    error = (whole.values - reference[whole.index])[300:-300]
    assert np.std(error) < 0.02 * np.std(reference)


def test_a_turn_comes_before_all_else_that_an_axis_does():
    _, _, reference, _ = motion(4)
    turn = {"cause": "misalignment", "roll_deg": 12.0, "pitch_deg": -8.0, "yaw_deg": 25.0}
    behind = {"x": [{"cause": "cubic_stiffness", "alpha3": 2e-3},
                    {"cause": "low_pass_lag", "corner_hz": 40.0}],
              "y": [{"cause": "backlash", "gap": 0.5}, {"cause": "sensitivity_error", "gain": 0.8}],
              "z": []}
    plain, turns = (SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "axes": {
            axis: {"core": {"natural_frequency_hz": 120.0, "damping_ratio": 0.4},
                   "effects": [*before, *effects]} for axis, effects in behind.items()}})
        for before in ([], [turn]))
    np.testing.assert_allclose(simulate(turns, reference, RATE),
                               simulate(plain, turned(reference, 12.0, -8.0, 25.0), RATE),
                               atol=1e-9)


def test_a_turn_is_undone_behind_what_else_an_axis_does():
    _, t, reference, _ = motion(4)
    turn = {"cause": "misalignment", "yaw_deg": 30.0}
    slow = {"cause": "low_pass_lag", "corner_hz": 60.0}
    core = {"natural_frequency_hz": 300.0, "damping_ratio": 0.7}
    sensor = SensorModel.from_dict({
        "schema": "frac_accel/sensor_model/1", "core": core, "effects": [turn],
        "axes": {"x": {"core": core, "effects": [turn, slow]}}})
    made = samples(t, simulate(sensor, reference, RATE))
    corrected = Corrector(sensor, RATE, noise_std=0.01).process(made.stamps_ns, made.values)
    error = (corrected.values - reference[corrected.index])[300:-300]
    assert np.std(error) < 0.02 * np.std(reference)


@pytest.mark.parametrize("angles", [(1.0, -2.0, 3.0), (12.0, -9.0, -7.0)])
def test_found_again_and_nothing_else(angles):
    rng, t, reference, output = motion(2)
    values = turned(output, *angles) + 0.01 * rng.normal(size=(N, 3))
    diagnosis = found(t, reference, values)
    assert [finding.cause for finding in diagnosis.findings] == ["misalignment"]
    effect = diagnosis.findings[0].effect
    np.testing.assert_allclose([effect.roll_deg, effect.pitch_deg, effect.yaw_deg], angles,
                               atol=0.1)


@pytest.mark.parametrize("shares", [{"y": 0.03}, {"y": 0.05, "z": -0.04}])
def test_a_cross_axis_sensitivity_is_no_turn(shares):
    rng, t, reference, output = motion(3)
    values = output + 0.01 * rng.normal(size=(N, 3))
    for axis, share in shares.items():
        values[:, 0] += share * output[:, "xyz".index(axis)]
    for sensor in (values, values * [1, 0, 0]):
        diagnosis = found(t, reference, sensor)
        assert [f.cause for f in diagnosis.findings] == ["cross_axis_sensitivity"]


def behind_play(motion, gap):
    """What play of this whole width leaves of a motion, shape (n,)."""
    out, at = np.empty(len(motion)), 0.0
    for i, here in enumerate(motion):
        at = min(max(at, here - gap / 2), here + gap / 2)
        out[i] = at
    return out


@pytest.mark.parametrize("mixed", ["misalignment", "cross_axis_sensitivity"])
@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.thorough),
                                  pytest.param(1, marks=[pytest.mark.thorough, pytest.mark.long])])
def test_of_one_axis_its_play_tells_a_turn_from_a_cross_axis_sensitivity(mixed, seed):
    rng = np.random.default_rng([19, seed])
    sines, fine = [Multisine(rng, band_hz=(1.0, 60.0)) for _ in range(3)], 16
    t = np.arange(fine * N) / (fine * RATE)
    output = np.stack([sine.motion(t) for sine in sines], axis=1)
    pitch, yaw = rng.uniform(3, 7, 2) * rng.choice([-1, 1], 2)
    if mixed == "misalignment":
        seen = behind_play(turned(output, 0.0, pitch, yaw)[:, 0], 0.5)
    else:
        seen = behind_play(output[:, 0], 0.5) + output[:, 1:] @ np.radians([yaw, pitch])
    reference = np.stack([sine.acceleration(t) for sine in sines], axis=1)[::fine]
    values = np.outer(seen[::fine] + 0.002 * rng.normal(size=N), [1, 0, 0])
    diagnosis = found(times(N / RATE), reference, values)
    assert {finding.cause for finding in diagnosis.findings} == {mixed, "backlash"}
    effect = next(f.effect for f in diagnosis.findings if f.cause == mixed)
    assert ((effect.pitch_deg, effect.yaw_deg) == pytest.approx((pitch, yaw), abs=0.05)
            if mixed == "misalignment" else
            (effect.y, effect.z) == pytest.approx(np.radians([yaw, pitch]), abs=0.002))


def test_exchanged_axes_are_said_in_words():
    effect = model({"cause": "misalignment", "yaw_deg": 90.0}).axes[0].effects[0]
    assert "the sensor's x is the reference's y" in effect.explanation
    assert "the sensor's y is the reference's minus x" in effect.explanation
    slight = model({"cause": "misalignment", "yaw_deg": 2.0}).axes[0].effects[0]
    assert slight.explanation == type(slight).explanation


@pytest.mark.parametrize("seed", range(20))
def test_what_one_axis_does_not_see_the_others_show(seed):
    rng = np.random.default_rng([147, seed])
    axis, truth = int(rng.integers(3)), Rotation.random(random_state=seed)
    about = Rotation.from_rotvec(rng.uniform(-3, 3) * np.eye(3)[axis])
    started = Misalignment.of_turn((truth * about).inv().as_matrix())
    shares = rng.uniform(0.5, 2) * truth.inv().as_matrix()
    effect = started.with_other_axes(axis, shares)
    np.testing.assert_allclose(effect.rotation, truth.as_matrix(), atol=2e-3)
    np.testing.assert_allclose(effect.share_of_axes(axis), started.share_of_axes(axis), atol=1e-12)
    shares[(axis + 1) % 3] = np.nan  # not measured
    assert started.with_other_axes(axis, shares) is started


@pytest.mark.parametrize("seed", range(4))
def test_a_turn_beside_a_delay_is_that_of_all_axes(seed):
    """The turn about the axis itself was what the delay makes of axes that move together, 10
    degrees; the angles beside it were off by it, and the model turned the other axes by it."""
    rng, fine, count = np.random.default_rng([148, seed]), 8, 6000
    motion = sosfiltfilt(butter(2, [0.02, 0.2], "band", fs=fine, output="sos"),
                         rng.normal(size=(fine * count + 2 * fine, 3)), axis=0)
    # two axes swing together, as a body that pitches does
    motion[:, 1] += 0.7 * hilbert(motion[:, 0]).imag
    motion[:, 2] -= 0.5 * hilbert(motion[:, 0]).imag
    motion /= motion.std(axis=0)
    angles = rng.uniform(1.5, 4.0, 3) * rng.choice([-1, 1], 3)
    late = int(rng.integers(2, 5))
    reference = motion[fine:][:fine * count:fine]
    values = turned(motion[fine - late:][:fine * count:fine], *angles)
    values = values + 0.02 * rng.normal(size=values.shape)
    t = np.arange(count) / RATE
    diagnosis = diagnose((samples(t, reference), samples(t, values)), axis="xyz"[seed % 3])
    effect, = (f.effect for f in diagnosis.findings if f.cause == "misalignment")
    np.testing.assert_allclose([effect.roll_deg, effect.pitch_deg, effect.yaw_deg], angles,
                               atol=0.15)


def test_a_stated_turn_stays_as_it_is_stated():
    """x does not see a roll: what the other axes show of it is no matter of a diagnosis of x."""
    rng, t, reference, output = motion(4)
    values = turned(output, 25.0, 0.0, 3.0) + 0.01 * rng.normal(size=(N, 3))
    stated = {"cause": "misalignment", "roll_deg": 10.0, "pitch_deg": 0.0, "yaw_deg": 3.0}
    diagnosis = diagnose((samples(t, reference), samples(t, values)), model(stated))
    effect, = (e for e in diagnosis.model.axis("x").effects if e.cause == "misalignment")
    assert effect.roll_deg == 10.0
    assert not diagnosis.findings


@pytest.mark.parametrize("pitch", [-89.8, 89.8])
def test_of_a_body_that_stands_on_end_one_angle_is_known_for_two(pitch):
    """Roll and yaw moved together leave the turn as it is; what the words give does not move."""
    rng = np.random.default_rng(6)
    roll, yaw, both = rng.uniform(-180, 180, 3)
    turns = [Misalignment(roll, pitch, yaw),
             Misalignment(roll + both, pitch, yaw + both * np.sign(pitch))]
    assert np.allclose(turns[0].rotation, turns[1].rotation, atol=0.02)
    words = [turn.words_of_turn(1.5) for turn in turns]
    assert words[0] == words[1] and "± 1.5 degrees, is known" in words[0][0]
    assert Misalignment(roll, pitch / 2, yaw).words_of_turn(1.5) == []


@pytest.mark.parametrize("seed", range(3))
def test_each_axis_has_its_gain_behind_the_turn(seed):
    """Shares of other axes came with the own gain left out."""
    rng, t, reference, _ = motion(40 + seed)
    angles, gains, rate = rng.uniform(-8, 8, 3), rng.uniform(0.6, 1.4, 3), rng.uniform(0.01, 0.03)
    turn = {"cause": "misalignment", **dict(zip(("roll_deg", "pitch_deg", "yaw_deg"),
                                                map(float, angles)))}

    def of_axes(*more):
        return SensorModel.from_dict({**model().to_dict(), "axes": {
            axis: {"effects": [{"cause": "sensitivity_error", "gain": float(gain)},
                               *([{"cause": "gain_drift", "rate_per_s": float(rate)}]
                                 if axis == "x" else []), *more]}
            for axis, gain in zip("xyz", gains)}})
    turned_first = simulate(of_axes(), turned(reference, *angles), RATE)
    np.testing.assert_allclose(simulate(of_axes(turn), reference, RATE), turned_first, atol=1e-9)
    made = samples(t, turned_first)
    back = Corrector(of_axes(turn), RATE, noise_std=0.01).process(made.stamps_ns, made.values)
    error = (back.values - reference[back.index])[300:-300]
    assert np.std(error) < 0.02 * np.std(reference)


@pytest.mark.parametrize("seed", range(3))
def test_a_turn_is_that_of_the_sensor_whatever_its_gain(seed):
    """Of a gain of 0.85 the angles were 0.85 of what they are, by up to 400 standard
    uncertainties."""
    rng, t, reference, output = motion(50 + seed)
    angles, gain = rng.uniform(1, 3, 3) * rng.choice([-1, 1], 3), rng.uniform(0.7, 0.9)
    values = turned(output, *angles) * [gain, 1, 1] + 0.003 * rng.normal(size=(N, 3))
    by_cause = {f.cause: f for f in found(t, reference, values).findings}
    assert by_cause.keys() == {"sensitivity_error", "misalignment"}
    assert abs(by_cause["sensitivity_error"].effect.gain - gain) \
        < 4 * by_cause["sensitivity_error"].std["gain"]
    turn = by_cause["misalignment"]
    for name, angle in zip(("pitch_deg", "yaw_deg"), angles[1:]):
        assert abs(getattr(turn.effect, name) - angle) < 4 * turn.std[name]


@pytest.mark.parametrize("seed", range(2))
def test_a_gain_that_warms_acts_on_what_a_turn_shows_of_gravity(seed):
    """A zero that changes with temperature was named beside it."""
    rng, t, reference, _ = motion(60 + seed)
    reference = reference + [0, 0, 9.81]
    angles, coefficient = rng.uniform(1, 2, 3) * rng.choice([-1, 1], 3), rng.uniform(3e-3, 6e-3)
    warm = 25 + 20 * np.sin(2 * np.pi * 0.4 * t / t[-1] + rng.uniform(0, 6))
    values = simulate(model(), turned(reference, *angles), RATE)
    values[:, 0] *= 1 + coefficient * (warm - 25)
    values += 0.003 * rng.normal(size=values.shape)
    pair = samples(t, reference), samples(t, values)
    named = {f.cause: f for f in diagnose(
        pair, model(), "x", temperature=(pair[1].stamps_ns, warm)).findings}
    assert named.keys() - {"offset"} == {"temperature_sensitivity", "misalignment"}
    warming = named["temperature_sensitivity"]
    assert abs(warming.effect.coefficient_per_k - coefficient) \
        < 4 * warming.std["coefficient_per_k"]


@pytest.mark.parametrize("seed", range(2))
def test_a_zero_that_cancels_what_a_turn_shows_of_gravity_is_one(seed):
    """Both were in doubt as causes that nearly cancel."""
    rng, t, reference, _ = motion(70 + seed)
    reference = reference + [0, 0, 9.81]
    angles = rng.uniform(1.5, 2.5, 3) * rng.choice([-1, 1], 3)
    values = simulate(model(), turned(reference, *angles), RATE)
    zero = -rng.uniform(1.02, 1.1) * float(values[:, 0].mean())
    values += [zero, 0, 0] + 0.003 * rng.normal(size=values.shape)
    named = {f.cause: f for f in found(t, reference, values).findings}
    assert named.keys() == {"offset", "misalignment"}
    assert abs(named["offset"].effect.offset - zero) < 4 * named["offset"].std["offset"]
    assert abs(named["misalignment"].effect.pitch_deg - angles[1]) < 0.05
