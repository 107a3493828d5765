"""`frac_accel budget`: what it writes and says; it answers wherever a record can be read."""

import json

import numpy as np
import pytest
import real_records
from budget_cases import excitation

from frac_accel.budget import PARTS
from frac_accel.cli import main
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, write_bag
from frac_accel.io.samples import Samples

REAL = pytest.mark.skipif(not real_records.FOLDER.is_dir(),
                          reason="the records in ../shared/data are not here")


def written(path, rate=100.0, other_rate=None, gain=0.9, n=3000, second=False):
    """Bag of a sensor with a gain and noise, read at a rate of its own."""
    rng = np.random.default_rng(0)
    reference, _ = excitation(rng, n)
    t = np.arange(n) / rate
    other = np.arange(0, t[-1], 1 / (other_rate or rate))
    values = gain * np.stack([np.interp(other, t, reference[:, i]) for i in range(3)], axis=1)
    stamps = [np.round(x * 1e9).astype(np.int64) + 10**18 for x in (t, other)]
    topics = {REFERENCE_TOPIC: Samples.of(stamps[0], reference),
              RAW_TOPIC: Samples.of(stamps[1], values + 0.01 * rng.normal(size=values.shape))}
    if second:
        topics["/imu/second"] = Samples.of(
            stamps[1], values + 0.01 * rng.normal(size=values.shape))
    write_bag(path, topics)
    return str(path)


def result(tmp_path, bag, *options):
    file = tmp_path / "r.json"
    assert main(["budget", bag, "--json", str(file), *options]) == 0
    return json.loads(file.read_text("utf-8"))


def test_result_file(tmp_path, capsys):
    found = result(tmp_path, written(tmp_path / "a.mcap"))
    words, gain, *_ = found["model"].split(", ")
    assert words == "the best static gain" and float(gain) == pytest.approx(0.9, abs=2e-3)
    assert {entry["part"] for entry in found["budget"]} <= set(PARTS)
    for entry in found["budget"]:
        low, high = entry["ci95"]
        assert 0 <= low <= entry["share"] <= high <= 1
    assert sum(entry["share"] for entry in found["budget"]) == pytest.approx(1)
    assert found["established_noise"] == {"rms": None, "by": None}
    assert "nothing in the record shows that it is noise" in capsys.readouterr().out


def test_model_stated_noise_and_second_sensor(tmp_path):
    bag = written(tmp_path / "a.mcap", second=True)
    model = tmp_path / "m.yaml"
    model.write_text("schema: frac_accel/sensor_model/1\ncore: {natural_frequency_hz: 4000, "
                     "damping_ratio: 0.7, sensitivity: 1.0}\n", "utf-8")
    found = result(tmp_path, bag, "--model", str(model), "--noise-std", "0.01",
                   "--second-sensor", "/imu/second")
    shares = {entry["part"]: entry["share"] for entry in found["budget"]}
    assert found["model"] == "the given model"
    assert shares["linear"] > 0.8 and "reference" in shares
    assert found["established_noise"] == {"rms": 0.01, "by": "stated"}


def test_unequal_rates_are_brought_together(tmp_path, capsys):
    found = result(tmp_path, written(tmp_path / "a.mcap", other_rate=71.0))
    assert found["rms"] < 0.5 * found["output_rms"]
    assert "compared at 71 Hz" in capsys.readouterr().err


def test_bad_input_is_one_line(tmp_path, capsys):
    stamps = np.arange(3000) * 10_000_000 + 10**18
    path = tmp_path / "still.mcap"
    write_bag(path, {REFERENCE_TOPIC: Samples.of(stamps, np.random.default_rng(0).normal(
        size=(3000, 3))), RAW_TOPIC: Samples.of(stamps, np.zeros((3000, 3)))})
    assert main(["budget", str(path)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def independent_correlation(bag):
    """Correlation of both phones' residuals by 41 taps, fitted on one half, judged on the other."""
    from frac_accel.record import Record
    left = []
    for topic in (RAW_TOPIC, "/phone2/data_raw"):
        pair = Record.load(bag, sensor=topic)
        x, y = (v[:, 0] - v[:, 0].mean() for v in (pair.reference, pair.sensor))
        first = np.arange(len(x)) < len(x) // 2
        columns = np.stack([np.roll(x, k) for k in range(-20, 21)], axis=1)
        predicted = np.where(first, *(columns @ np.linalg.lstsq(
            columns[rows], y[rows], rcond=None)[0] for rows in (~first, first)))
        left.append(y - predicted)
    # rolled ends are no data
    return np.corrcoef(*(values[20:-20] for values in left))[0, 1]


@REAL
@pytest.mark.real_data
@pytest.mark.parametrize("test", [1, 5, 9])
def test_two_phones_share_what_an_independent_fit_says(tmp_path, test):
    bag = real_records.FOLDER / f"shaking_table_earthquake-test{test}.mcap"
    found = result(tmp_path, str(bag), "--second-sensor", "/phone2/data_raw")
    parts = {entry["part"]: entry for entry in found["budget"]}
    # of what is neither linear nor otherwise explained, as the independent fit counts it
    rest = parts["reference"]["share"] + parts["noise"]["share"]
    low, high = (bound / rest for bound in parts["reference"]["ci95"])
    other = independent_correlation(bag)
    assert 0.15 < other < 0.35
    assert low < other < high
    assert parts["reference"]["share"] / rest == pytest.approx(other, abs=0.1)
    assert found["established_noise"]["by"] is None


@REAL
@pytest.mark.real_data
def test_measured_records_are_parted_as_they_truly_are(tmp_path):
    def shares(name, *options):
        found = result(tmp_path, str(real_records.FOLDER / f"{name}.mcap"), *options)
        return {entry["part"]: entry["share"] for entry in found["budget"]}, found
    bouc_wen, found = shares("bouc_wen")
    # hysteresis is odd; its authors' noise is all that does not repeat
    assert bouc_wen["odd"] > 10 * bouc_wen["even"]
    assert bouc_wen["noise"] < 0.01
    assert found["established_noise"]["by"] == "periods"
    silverbox, _ = shares("silverbox")
    assert silverbox["odd"] > 5 * (silverbox["even"] + silverbox["noise"])
    filtered, _ = shares("mpu9250_response")
    assert filtered["linear"] > 0.99
    # the phone lies turned: its z is the car's x
    car, _ = shares("phone_in_car", "--axis", "z")
    assert car["across"] > 0.6
