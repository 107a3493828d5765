"""What is named of the measured records, and how much is left: docs/real_records.md."""

import pytest
from real_records import FOLDER

from frac_accel import diagnose

pytestmark = [pytest.mark.real_data, pytest.mark.thorough, pytest.mark.skipif(
    not FOLDER.is_dir(), reason="the records in ../shared/data are not here")]


@pytest.mark.parametrize("record, names, verdicts, left", [
    ("silverbox", {"offset", "cubic_stiffness", "quadratic_stiffness"}, {"explained"}, 0.006),
    ("bouc_wen", {"hysteresis"}, {"explained"}, 0.013),
    ("emps_velocity", {"free_mass_friction"}, {"explained"}, 0.06),
    ("mpu9250_response", {"linear_phase_filter", "time_delay"}, {"explained"}, 0.003),
    ("mems_package_sweep", {"clock_skew", "polled_readout"}, {"explained"}, 0.025),
    ("board_on_shaker", {"offset"}, {"explained"}, 0.035),
    ("phone_in_car", {"misalignment"}, {"undecided"}, 0.6),
    ("shock_ptb", set(), {"unexplained", "undecided"}, 0.2)])
def test_names_of_a_measured_record(record, names, verdicts, left):
    found = diagnose(FOLDER / f"{record}.mcap", time_limit_s=200)
    assert {finding.cause for finding in found.findings} == names
    assert found.verdict in verdicts
    assert found.extended["nrmse"] < left


@pytest.mark.parametrize("topic, rate_hz", [("/imu/data_raw", 101.67), ("/phone2/data_raw", 102.5)])
@pytest.mark.parametrize("test", [1, 5, 9])
def test_a_phone_samples_by_the_same_clock_in_each_record(test, topic, rate_hz):
    """Nothing was named, and no filter takes what is left; the two phones have a clock each."""
    found = diagnose(FOLDER / f"shaking_table_earthquake-test{test}.mcap", sensor=topic,
                     time_limit_s=200)
    findings = {finding.cause: finding for finding in found.findings}
    assert "polled_readout" in findings and findings.keys() <= {"polled_readout",
                                                                "reference_delay"}
    polled = findings["polled_readout"]
    assert 1 / polled.effect.interval_s == pytest.approx(rate_hz, abs=0.05)
    assert polled.gain.ci95[0] > 0.03
    assert found.extended["nrmse"] < 0.1
