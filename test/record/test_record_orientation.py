"""How a sensor lies against its reference is found from the motion, with its uncertainty."""

import numpy as np
import pytest
from real_records import FOLDER
from scipy.spatial.transform import Rotation
from test_record_pairing import coloured, samples

from frac_accel import FracAccelError, diagnose, identify, read_bag
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.io.samples import Samples
from frac_accel.record import Orientation, Record

RATE_HZ = 100.0
N = 6000


def turned_record(rng, turn, gain=1.0, noise=0.2, moving=(0, 1, 2), late_s=0.0):
    """A sensor that lies turned, with gravity on one axis and noise."""
    t = np.arange(N) / RATE_HZ
    motion = np.zeros((N, 3))
    motion[:, moving] = coloured(rng, N, 0.8)[:, :len(moving)]
    answer = gain * motion @ np.asarray(turn).T
    answer = answer + noise * motion[:, moving[0]].std() * rng.normal(size=(N, 3))
    answer[:, int(rng.integers(3))] += 9.81
    return samples(t + late_s, motion), samples(t, answer)


@pytest.mark.parametrize("seed", range(8))
def test_any_rotation_is_found_within_its_uncertainty(seed):
    rng = np.random.default_rng([20261122, seed])
    turn, gain = Rotation.random(random_state=rng.integers(1 << 31)).as_matrix(), rng.uniform(.5, 2)
    found = Orientation.of(Record.of(*turned_record(rng, turn, gain)))
    off = np.degrees(Rotation.from_matrix(found.rotation @ turn.T).magnitude())
    assert off < 4 * found.angle_std_deg < 4
    assert found.gain == pytest.approx(gain, abs=4 * found.gain_std)
    assert not found.mirrored
    assert np.linalg.det(found.rotation) == pytest.approx(1)


def test_uncertainties_are_those_of_a_monte_carlo():
    turn = Rotation.from_euler("xyz", [10, -20, 70], degrees=True).as_matrix()
    found = [Orientation.of(Record.of(*turned_record(np.random.default_rng(seed), turn, 0.9)))
             for seed in range(60)]
    gains = np.array([one.gain for one in found])
    assert abs(gains.mean() - 0.9) < 4 * gains.std() / np.sqrt(60)
    assert np.mean([one.gain_std for one in found]) == pytest.approx(gains.std(), rel=0.4)


def test_a_sensor_with_a_dead_axis_is_not_turned_by_angles_that_nothing_shows():
    reference, sensor = turned_record(np.random.default_rng(0), [[0, 0, 1], [0, -1, 0], [1, 0, 0]],
                                      moving=(0, 1))
    values = sensor.values.copy()
    values[:, 1] = 0.0
    with pytest.raises(FracAccelError, match="axes are exchanged: sensor z follows reference x"):
        diagnose((reference, Samples.of(sensor.stamps_ns, values)))


@pytest.mark.parametrize("turn, words", [
    ([[0, -1, 0], [1, 0, 0], [0, 0, 1]],
     "sensor x follows reference -y, sensor y follows reference x, sensor z follows reference z"),
    ([[0, 0, 1], [1, 0, 0], [0, 1, 0]],
     "sensor x follows reference z, sensor y follows reference x, sensor z follows reference y"),
])
def test_exchanged_axes_in_words(turn, words):
    found = Orientation.of(Record.of(*turned_record(np.random.default_rng(0), turn)))
    assert found.words.startswith(words)
    assert "turned" not in found.words and "reversed" not in found.words


def test_nothing_is_said_of_aligned_axes():
    found = Orientation.of(Record.of(*turned_record(np.random.default_rng(1), np.eye(3))))
    assert found.aligned and found.words == "" and not found.astray("x")


def test_a_small_turn_is_an_angle():
    turn = Rotation.from_euler("z", 12, degrees=True).as_matrix()
    found = Orientation.of(Record.of(*turned_record(np.random.default_rng(2), turn)))
    assert found.turned_deg == pytest.approx(12, abs=4 * found.angle_std_deg)
    assert "turned by a further 12" in found.words


def test_reversed_polarity_of_one_axis():
    found = Orientation.of(Record.of(*turned_record(np.random.default_rng(3),
                                                    np.diag([1, 1, -1]))))
    assert found.mirrored
    assert "sensor z follows reference -z" in found.words and "reversed" in found.words


def test_two_axes_that_move_give_the_third():
    turn = Rotation.from_euler("xyz", [90, 0, 30], degrees=True).as_matrix()
    found = Orientation.of(Record.of(*turned_record(np.random.default_rng(4), turn,
                                                    moving=(0, 1))))
    assert np.max(np.abs(found.rotation - turn)) < 0.02


def test_one_axis_that_moves_leaves_the_others_open():
    found = Orientation.of(Record.of(*turned_record(
        np.random.default_rng(5), np.eye(3)[[1, 0, 2]], moving=(0,))))
    assert np.isnan(found.rotation[:, 1:]).all()
    assert found.followed("y") == "x"
    with pytest.raises(FracAccelError, match="one axis"):
        found.turn(Samples.of([0], [[1, 2, 3]]))


def test_turned_samples_lie_like_the_reference():
    rng = np.random.default_rng(6)
    turn = Rotation.from_euler("xyz", [80, 20, -30], degrees=True).as_matrix()
    reference, sensor = turned_record(rng, turn, noise=0.05, late_s=0.25)
    found = Orientation.of(Record.of(reference, sensor))
    assert found.offset_s == pytest.approx(-0.25, abs=2e-3)
    assert Orientation.of(Record.of(reference, found.turn(sensor))).words == ""


@pytest.mark.parametrize("seed", range(2))
def test_identify_and_diagnose_say_the_same_of_a_turned_sensor(seed):
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    record = turned_record(np.random.default_rng([7, seed]), turn)
    with pytest.raises(FracAccelError) as refused:
        identify(Record.of(*record))
    assert "exchanged: sensor x follows reference z" in str(refused.value)
    found = diagnose(record)
    assert any("lies turned: sensor x follows reference z" in line
               for line in found.as_dict()["integrity"])
    # its own signal, in the reference's axes, has no fault
    assert [finding.cause for finding in found.findings] == ["misalignment"]
    assert found.extended["nrmse"] < 0.21
    (misalignment,) = found.findings
    off = Rotation.from_matrix(misalignment.effect.rotation @ turn).magnitude()
    assert np.degrees(off) < 4 * misalignment.std["yaw_deg"]
    assert all(misalignment.effect in found.model.axis(axis).effects for axis in "xyz")


@pytest.mark.real_data
@pytest.mark.skipif(not (FOLDER / "phone_in_car.mcap").exists(), reason="no measured records here")
def test_phone_in_car():
    """As recorded: uneven CAN, a turned phone; independent least squares give the same figures."""
    bag = FOLDER / "phone_in_car.mcap"
    topics = read_bag(bag, [REFERENCE_TOPIC, RAW_TOPIC])
    record = Record.of(topics[REFERENCE_TOPIC], topics[RAW_TOPIC])
    assert record.sampling_rate_hz == pytest.approx(10, abs=0.01)
    assert record.band_hz == pytest.approx(4, abs=0.01)
    assert record.topics[0].clock.kind == "uneven"
    # 0.01 g: it is the car's values that are rounded to it
    assert record.step("reference", 0) == pytest.approx(0.0980665, rel=1e-6)
    assert any("multiples of 0.0980665 (0.01 g)" in line for line in record.integrity(0).words)
    assert record.offset_s == pytest.approx(-0.2, abs=0.05)
    assert record.offset_std_s < 0.05
    assert any("before the reference" in words for words in record.words)
    found = Orientation.of(record)
    assert found.gain == pytest.approx(0.98, abs=0.03)
    assert found.words.startswith("sensor y follows reference -y, sensor z follows reference x")
    # without the turn, by a fit of all coefficients on the values as they are
    lead = round(-record.offset_s * record.sampling_rate_hz)
    x, y = record.reference[lead:, :2], record.sensor[:-lead]
    direct = np.linalg.lstsq(np.c_[x, np.ones(len(x))], y, rcond=None)[0][:2].T
    assert np.max(np.abs(direct - found.gain * found.rotation[:, :2])) < 0.06
