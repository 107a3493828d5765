"""A stamp that is far ahead: one clear line at once, never an array over the whole time."""

import resource
import time
from pathlib import Path

import pytest

from frac_accel.cli import main
from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, read_bag, write_bag

BAGS = Path(__file__).parents[2] / "bags"
MODEL = str(BAGS / "classical_bench.yaml")
HOUR, YEAR, CENTURY_TURN = 3600, 365 * 86400, 2**31 - 1


def with_stamps_ahead(path, seconds, places):
    topics = read_bag(BAGS / "classical_bench.mcap")
    for name in (REFERENCE_TOPIC, RAW_TOPIC):
        stamps = topics[name].stamps_ns.copy()
        if seconds == CENTURY_TURN:
            stamps[places] = seconds * 10**9
        else:
            stamps[places] += seconds * 10**9
        topics[name] = topics[name]._replace(stamps_ns=stamps)
    write_bag(path, topics)
    return str(path)


@pytest.mark.parametrize("seconds", [HOUR, YEAR, CENTURY_TURN])
@pytest.mark.parametrize("places", [-1, 1500, slice(2000, None)], ids=["last", "middle", "rest"])
@pytest.mark.parametrize("verb", ["simulate", "identify", "validate", "diagnose"])
def test_a_stamp_far_ahead_is_one_line(tmp_path, capsys, verb, seconds, places):
    if places == slice(2000, None) and seconds == CENTURY_TURN:
        places = slice(-2, None)
    bag = with_stamps_ahead(tmp_path / "b.mcap", seconds, places)
    options = {"simulate": ["--model", MODEL, "-o", str(tmp_path / "o.mcap")],
               "identify": ["-o", str(tmp_path / "o.yaml")],
               "validate": ["--model", MODEL], "diagnose": ["--model", MODEL]}[verb]
    start, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert main([verb, bag, *options]) == 2
    assert time.process_time() - start < 5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < before + 200 * 1024
    line, = capsys.readouterr().err.strip().splitlines()
    assert "stamps jump by" in line
    assert [path.name for path in tmp_path.iterdir()] == ["b.mcap"]


def test_correct_starts_anew_after_the_jump(tmp_path):
    for places in (-1, slice(2000, None)):
        bag = with_stamps_ahead(tmp_path / "b.mcap", YEAR, places)
        assert main(["correct", bag, "--model", MODEL, "-o", str(tmp_path / "o.mcap")]) == 0

