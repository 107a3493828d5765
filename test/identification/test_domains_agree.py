"""Time domain and frequency domain find the same parameters, from whatever a lab records."""

import json

import numpy as np
import pytest
import rig
from lab_records import EXCITATIONS, RATE_HZ, X_ONLY, draw_sensor, noisy, pair_of, relative_error

from frac_accel import identify, write_bag
from frac_accel.cli import main
from frac_accel.errors import IdentificationError
from frac_accel.identification import response_points
from frac_accel.identification.fit.frequency_domain import fit_response
from frac_accel.identification.fit.output_error import fit_output_error
from frac_accel.identification.fit.structures import FractionalStructure, OscillatorStructure
from frac_accel.identification.judge.agreement import compare_domains
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC
from frac_accel.io.samples import Samples

PARAMETERS = ("sensitivity", "natural_frequency_hz", "damping_ratio", "delay_s")


def truth(sensor, names=PARAMETERS):
    return np.array([{**sensor.core, **sensor.effects["time_delay"]}[name] for name in names])


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_both_domains_agree_and_are_right(kind):
    rng = np.random.default_rng(20700)
    scores = []
    for _ in range(3):
        sensor = draw_sensor(rng)
        record = rig.simulate_record(sensor, EXCITATIONS[kind](rng))
        pair = pair_of(record, noisy(record, rng, rng.uniform(30, 60), rng.choice([0.0, 0.9])))
        result = identify(pair, structure="oscillator")
        assert result.excitation.kind == kind
        other = result.frequency_domain
        assert other["agrees"], other["words"]
        for found in (result.parameters, other["parameters"]):
            values, std = np.array([[found[name]["value"], found[name]["std"]]
                                    for name in PARAMETERS]).T
            scores.append((values - truth(sensor)) / std)
    # 24 scores, correlated in fours: beyond 3.6 with a probability of less than 1 %
    assert np.max(np.abs(scores)) < 3.6


@pytest.mark.parametrize("kind", ["noise", "multisine"])
def test_intervals_of_the_frequency_domain_cover_the_truth(kind):
    rng = np.random.default_rng(20701)
    scores = []
    for _ in range(6):
        sensor = draw_sensor(rng)
        record = rig.simulate_record(sensor, EXCITATIONS[kind](rng))
        for pole in (0.0, 0.9):
            points = response_points(pair_of(record, noisy(record, rng, 30, pole)))
            found = fit_response(OscillatorStructure(), points, RATE_HZ)
            scores.append((found.values - truth(sensor, found.names)) / found.std)
    # 48 correlated trials of 0.95
    assert np.mean(np.abs(scores) < 1.96) >= 0.85
    assert np.sqrt(np.mean(np.square(scores))) < 1.35


def test_fractional_damping_from_dwells():
    rng = np.random.default_rng(20702)
    for _ in range(2):
        sensor = rig.draw_sensor(rng, RATE_HZ, "fractional", ["time_delay"],
                                 natural_frequency=(0.1, 0.2), damping_ratio=(0.1, 0.5))
        record = rig.simulate_record(sensor, EXCITATIONS["stepped_sine"](rng), rng, snr_db=60)
        points = response_points(pair_of(record))
        found = fit_response(FractionalStructure(), points, RATE_HZ)
        assert np.max(np.abs(found.values - truth(sensor, found.names)) / found.std) < 3.6
        assert found.reduced_chi_squared < 2
        assert abs(found["damping_order"] - sensor.core["damping_order"]) < 0.01


def test_evenly_spaced_dwells_do_not_lead_the_delay_astray():
    """Their correlation has a peak at every period of the spacing."""
    rng = np.random.default_rng(20703)
    sensor = draw_sensor(rng)
    excitation = rig.stepped_sine(RATE_HZ, 8.0, np.linspace(40, 700, 20), X_ONLY)
    record = rig.simulate_record(sensor, excitation, rng, snr_db=60)
    result = identify(pair_of(record), structure="oscillator")
    delay = result.parameters["delay_s"]["value"]
    assert delay == pytest.approx(sensor.effects["time_delay"]["delay_s"], abs=1e-6)
    assert result.frequency_domain["agrees"]


def test_a_changed_sensor_makes_them_disagree():
    """Points of a sensor whose resonance is half a percent off the one fitted in time."""
    rng = np.random.default_rng(20704)
    sensor = draw_sensor(rng)
    higher = {**sensor.core,
              "natural_frequency_hz": 1.005 * sensor.core["natural_frequency_hz"]}
    excitation = EXCITATIONS["noise"](rng)
    here, there = (pair_of(rig.simulate_record(rig.Sensor(core, sensor.effects), excitation, rng,
                                               snr_db=60)) for core in (sensor.core, higher))
    fit = fit_output_error(OscillatorStructure(), here.reference[:, 0], here.sensor[:, 0], RATE_HZ)
    same, other = (compare_domains(fit, fit_response(OscillatorStructure(), response_points(pair),
                                                     RATE_HZ)) for pair in (here, there))
    assert same["agrees"] and "domain agree" in same["words"]
    assert not other["agrees"] and "domain disagree" in other["words"]
    assert other["largest_difference"]["combined_std"] > 5


def test_what_no_linear_sensor_does_is_not_fitted():
    """A gain that drifts while the frequency is stepped."""
    rng = np.random.default_rng(20707)
    drawn = draw_sensor(rng)
    sensor = rig.Sensor(drawn.core, {**drawn.effects, "gain_drift": {"rate_per_s": 0.02}})
    record = rig.simulate_record(sensor, EXCITATIONS["stepped_sine"](rng), rng, snr_db=60)
    points = response_points(pair_of(record))
    assert np.max(np.abs(relative_error(points, sensor))) > 0.1
    assert fit_response(OscillatorStructure(), points, RATE_HZ).reduced_chi_squared > 100


def test_too_few_points_are_refused():
    rng = np.random.default_rng(20705)
    excitation = rig.stepped_sine(RATE_HZ, 1.5, [100.0, 300.0], X_ONLY)
    points = response_points(pair_of(rig.simulate_record(draw_sensor(rng), excitation, rng)))
    with pytest.raises(IdentificationError, match="2 points of the frequency response cannot"):
        fit_response(OscillatorStructure(), points, RATE_HZ)


@pytest.mark.parametrize("kind, words", [
    ("stepped_sine", r"stepped sine, 15 dwells from "),
    ("multisine", "no nonlinear distortion above the noise"),
])
def test_the_command_says_what_it_found(kind, words, tmp_path, capsys):
    rng = np.random.default_rng(20706)
    record = rig.simulate_record(draw_sensor(rng), EXCITATIONS[kind](rng), rng, snr_db=60)
    write_bag(tmp_path / "lab.mcap", {
        REFERENCE_TOPIC: Samples.of(record.stamps_ns, record.reference),
        RAW_TOPIC: Samples.of(record.sensor_stamps_ns, record.sensor)})
    assert main(["identify", str(tmp_path / "lab.mcap"), "-o", str(tmp_path / "m.yaml"),
                 "--structure", "oscillator", "--json", str(tmp_path / "r.json")]) == 0
    assert words in capsys.readouterr().out
    said = json.loads((tmp_path / "r.json").read_text())
    assert said["excitation"]["kind"] == kind
    assert len(said["points"]["amplitude"]) == len(said["points"]["frequency_hz"]) >= 15
    assert said["frequency_domain"]["agrees"] is True
