"""The verb `bench`: figures beside their peers, as a table and as JSON."""

import json
import math

import pytest

from frac_accel.bench.figures import Figure, table
from frac_accel.cli import main


def test_figures_as_table_and_json(tmp_path, capsys):
    pytest.importorskip("PyDynamic")
    file = tmp_path / "figures.json"
    assert main(["bench", "kernel", "uncertainty", "--rounds", "1", "--json", str(file)]) == 0
    result = json.loads(file.read_text())
    figures = {figure["name"]: figure for figure in result["figures"]}
    assert all(figure["value"] >= 0 and math.isfinite(figure["value"])
               for figure in figures.values())
    assert any("PyDynamic" in figure["peer"] for figure in figures.values())
    assert figures["largest relative difference to PyDynamic"]["verdict"] == "met"
    assert result["machine"]["cores"] and "numpy" in result["machine"]
    output = capsys.readouterr().out
    assert all(name in output for name in figures)
    assert "load average" in output


@pytest.mark.parametrize("arguments, words", [
    (["no_such"], "no suite no_such; there are kernel"), (["--rounds", "0"], "--rounds: 0 given")])
def test_what_is_not_there_is_refused(arguments, words, capsys):
    assert main(["bench", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_without_pydynamic_the_peer_is_left_out_and_said(monkeypatch, capsys):
    import importlib.util
    import sys
    found = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec",
                        lambda name, *more: None if name == "PyDynamic" else found(name, *more))
    monkeypatch.setitem(sys.modules, "PyDynamic", None)
    monkeypatch.setitem(sys.modules, "PyDynamic.uncertainty.propagate_filter", None)
    assert main(["bench", "uncertainty", "--rounds", "1"]) == 0
    output = capsys.readouterr().out
    assert "PyDynamic is not installed" in output
    assert "PyDynamic's time" not in output


def test_verdicts():
    assert [Figure("s", "n", value, "ms", least, most).verdict for value, least, most in (
        (1, None, None), (1, None, 2), (3, None, 2), (3, 2, None), (1, 2, None))] == [
        "", "met", "MISSED", "met", "MISSED"]
    assert table([Figure("live", "latency", 1.25, "ms", most=10)])[1].split() == [
        "live", "latency", "1.25", "ms", "at", "most", "10", "ms", "met"]


@pytest.mark.ros
def test_messages_are_counted_and_timed_over_dds(tmp_path):
    pytest.importorskip("rclpy")
    from frac_accel.bench import passage as bench
    model_file, design = bench.write_model(tmp_path, 1000.0)
    memory = []
    passage = bench.pass_through(bench.corrector_command(model_file, 1000.0), 1000.0, 1.5, design,
                                watch=memory.append)
    assert passage.lost == 0
    assert passage.sent == len(passage.latencies_ms) == 1500 - design.delay_samples
    assert 0 < passage.p50_ms <= passage.p99_ms <= passage.max_ms
    assert 0 < passage.cpu_us < 1e4
    assert memory and min(memory) > 10
