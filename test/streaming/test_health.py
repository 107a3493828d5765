"""Every reason for silence has a sentence, and so has everything else that is wrong."""

import dataclasses

import pytest

from frac_accel.streaming.health import ERROR, OK, WARN, Publisher, Situation, judge
from frac_accel.streaming.live_metrics import Findings

GOOD = Situation(
    topic="/imu/data_raw", model_file="m.yaml", publishers=(Publisher("/driver"),),
    seconds_since_message=0.1, sampling_rate_hz=2000.0, warm_up_samples=33,
    counters={"samples": 9000, "given": 8950, "waiting": 17},
    changes={"samples": 2000, "given": 2000}, findings=Findings(stamp_rate_hz=2000.0),
    reference_silent_s=0.1)
SILENT = {"samples": 2000, "given": 0}


def changed(**fields):
    return dataclasses.replace(GOOD, **fields)


def test_all_is_well():
    assert judge(GOOD) == (OK, "correcting at 2000 Hz")


def test_two_looks_in_a_row_are_no_silence():
    """As a timer that was late takes them."""
    assert judge(changed(changes={}, seconds_since_message=0.02))[0] == OK
    assert "are zero" in judge(changed(changes={}, seconds_since_message=0.02,
                                       zero_stamps=True))[1]


@pytest.mark.parametrize("situation, level, words", [
    (changed(model_file=""), ERROR, "no model: set the parameter model_file"),
    (changed(failure="cannot be met"), ERROR, "no filter: cannot be met"),
    (changed(publishers=(), seconds_since_message=None), WARN, "no publisher on /imu/data_raw:"),
    (changed(publishers=(), seconds_since_message=9.0), WARN, "no publisher on /imu/data_raw any"),
    (changed(publishers=(Publisher("/driver", "speaks Latin"),), seconds_since_message=None),
     ERROR, "nothing can be received on /imu/data_raw: /driver speaks Latin"),
    (changed(seconds_since_message=None), WARN, "no message on /imu/data_raw yet, though /driver"),
    (changed(seconds_since_message=12.3), WARN, "no message on /imu/data_raw for 12 s"),
    (changed(changes={"malformed": 5}), ERROR, "all 5 messages of the last second could not"),
    (changed(changes={}, designing=True), WARN, "the filter is being designed"),
    (changed(changes=SILENT, sampling_rate_hz=None, counters={"waiting": 40}), WARN,
     "estimating the sampling rate: 40 of 100 samples"),
    (changed(changes=SILENT, sampling_rate_hz=None, counters={"waiting": 100}), ERROR,
     "the stamps do not advance"),
    (changed(changes=SILENT | {"duplicates": 1500, "not_finite": 500}), ERROR,
     "1500 had the same stamp as the one before, 500 had a value that is not finite"),
    (changed(changes=SILENT | {"early": 2000}), ERROR, "sample_rate_hz may be too low"),
    (changed(changes=SILENT | {"restarts": 7}, stated_rate_hz=500.0), ERROR,
     "started anew 7 times in the last second because of gaps in the stamps: samples are lost, or "
     "sample_rate_hz is wrong, but the stamps advance at 2000 Hz"),
    (changed(changes={}, seconds_since_message=1.4), WARN, "no message on /imu/data_raw for 1.4 s"),
    (changed(changes={}, seconds_since_message=1.4, stale_s=1.4), ERROR, "output is 1.4 s old"),
    (changed(changes=SILENT, stale_s=2.0, stale_after_s=0.5), ERROR, "last output is 2.0 s"),
    (changed(changes=SILENT | {"implausible": 2000}), ERROR, "had a value that cannot be true"),
    (changed(changes=SILENT | {"without_rate": 2000}, sampling_rate_hz=None), ERROR,
     "too far apart to tell the sampling rate"),
    (changed(changes=SILENT | {"faulty": 2000}, faults=("", "dead", ""), on_fault="drop"), ERROR,
     "axis y says nothing but zero: no sample is given"),
    (changed(changes={"other_publisher": 900}, takes_first=False, other_publishers=("/b",)), ERROR,
     "/imu/data_raw has another publisher (/b): none is corrected"),
    (changed(changes=SILENT), WARN, "the filter is warming up: 17 of 33 samples"),
    (changed(changes=SILENT, zero_stamps=True, sampling_rate_hz=None, counters={"waiting": 4}),
     ERROR,
     "the stamps on /imu/data_raw are zero: let the driver stamp its messages"),
    (changed(model_file="", without_clock=True), ERROR,
     "use_sim_time is true, but nothing has come on /clock; no model"),
    (changed(without_clock=True), WARN, "nothing has come on /clock; correcting at 2000 Hz"),
    (changed(changes=GOOD.changes | {"unpublished": 3}), WARN,
     "3 corrected messages were not taken"),
])
def test_silence_is_explained(situation, level, words):
    assert judge(situation)[0] == level
    assert words in judge(situation)[1]


@pytest.mark.parametrize("situation, words", [
    (changed(changes=GOOD.changes | {"duplicates": 3}), "3 samples had the same stamp"),
    (changed(changes=GOOD.changes | {"gaps": 2, "filled": 5}), "2 gaps were bridged over 5"),
    (changed(changes=GOOD.changes | {"lost": 4}), "4 messages were lost on the way: raise depth"),
    (changed(refused_subscribers=("/logger (DURABILITY)",)), "subscriber that asks for another "
     "quality of service: /logger (DURABILITY)"),
    (changed(changes=GOOD.changes | {"late": 4}), "4 messages waited too long"),
    (changed(changes=GOOD.changes | {"gaps": 1, "filled": 1}), "1 gap was bridged over 1 sample"),
    (changed(changes=GOOD.changes | {"malformed": 4}), "4 messages could not be read"),
    (changed(stated_rate_hz=1000.0), "sample_rate_hz is 1000, but the stamps advance at 2000 Hz"),
    (changed(findings=Findings(clipped_axes="xz")), "axis x, z seems to be clipped"),
    (changed(findings=Findings(constant=True)), "does not change at all"),
    (changed(reference_silent_s=5.0), "the reference is lost: no message for 5 s"),
    (changed(findings=Findings(reference_overlaps=False)), "have no time in common"),
    (changed(load=0.97), "97% of a core"),
    (changed(faults=("", "", "not connected")),
     "axis z has never said anything but zero and counts as not connected: its covariance says so"),
    (changed(changes=GOOD.changes | {"implausible": 2}, learns_range=True),
     "2 samples had a value that cannot be true and were dropped (shocks of one or two samples "
     "look the same: state plausible_range to keep them)"),
    (changed(publishers=(Publisher("/a"), Publisher("/b", "is deaf"))), "publisher: /b is deaf"),
])
def test_troubles_are_warnings(situation, words):
    level, message = judge(situation)
    assert level == WARN
    assert words in message


@pytest.mark.parametrize("situation, words", [
    (changed(faults=("", "stuck", "")), "axis y is stuck at one value: its covariance says so"),
    (changed(faults=("held", "", "saturated")), "axis z is at the end of its range"),
    (changed(changes=GOOD.changes | {"other_publisher": 7}, other_publishers=("/b",),
             frames=("a", "b")),
     "has another publisher (/b) with frame 'b', whose 7 messages were dropped"),
])
def test_what_makes_an_axis_worthless_is_an_error(situation, words):
    level, message = judge(situation)
    assert level == ERROR
    assert words in message
