"""A case that is told has the record of the suite in its bag and the truth beside it."""

import json

import numpy as np
import pytest
import yaml
from blind.plan import Trial
from blind.tell import main, of_seed, truth
from rig.road_cases import draw_road_case

from frac_accel import read_bag


def test_bag_truth_and_model_are_of_the_same_case(tmp_path, capsys):
    assert main(["second_set", "11", "offset_step", "--times-noise", "5",
                 "--folder", str(tmp_path)]) == 0
    bag, told, model = capsys.readouterr().out.split()
    case = Trial("second_set", "", 11, ("offset_step",), 5.0).case()
    read = read_bag(bag)
    assert np.array_equal(read["/imu/data_raw"].values, case.record.sensor)
    assert np.array_equal(read["/imu/reference"].values, case.record.reference)
    with open(told) as stream:
        words = json.load(stream)
    assert words["hidden"] == case.truth and set(words["hidden"]) == {"offset_step"}
    assert words["effect_over_noise"]["offset_step"] == pytest.approx(5.0, rel=0.11)
    with open(model) as stream:
        assert yaml.safe_load(stream) == case.baseline.to_model()


def test_topics_with_rates_of_their_own_go_through_a_bag(tmp_path):
    seeds = (seed for seed in range(50))
    case = next(case for case in (draw_road_case(seed, {"thermal_offset"}, duration_s=4.0)
                                  for seed in seeds)
                if len(case.record.sensor) != len(case.record.reference))
    case.write(tmp_path / "road.mcap")
    read = read_bag(tmp_path / "road.mcap")
    assert np.array_equal(read["/imu/data_raw"].stamps_ns, case.record.sensor_stamps_ns)
    assert np.array_equal(read["/imu/reference"].stamps_ns, case.record.stamps_ns)
    assert len(case.samples()[2][0]) > 10
    json.dumps(truth(case))


def test_the_seed_alone_chooses_among_a_groups_cases(capsys):
    chosen = {of_seed("road_outside", seed).causes for seed in range(19)}
    assert len(chosen) == 19
    assert of_seed("road_clean", 3).causes == ()
    assert main(["single", "1", "no_such_cause"]) == 2
    assert "no such case" in capsys.readouterr().err
