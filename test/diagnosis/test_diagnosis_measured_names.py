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
    ("shaking_table_earthquake-test1", set(), {"unexplained", "undecided"}, 0.1),
    ("shaking_table_earthquake-test5", set(), {"unexplained", "undecided"}, 0.1),
    ("shaking_table_earthquake-test9", set(), {"unexplained", "undecided"}, 0.2),
    ("shock_ptb", set(), {"unexplained", "undecided"}, 0.2)])
def test_names_of_a_measured_record(record, names, verdicts, left):
    found = diagnose(FOLDER / f"{record}.mcap", time_limit_s=200)
    assert {finding.cause for finding in found.findings} == names
    assert found.verdict in verdicts
    assert found.extended["nrmse"] < left
