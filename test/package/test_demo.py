"""The demonstration identifies the sensor, corrects it live to the last bit, and shows both."""

import re

import pytest

from frac_accel import SensorModel, demo
from frac_accel.report.quantity import written


@pytest.mark.ros
def test_demo(tmp_path, capsys):
    assert demo.main(["--output-dir", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert {"identification.html", "model.yaml", "demo.mcap", "demo.txt", "demo.png"} <= {
        path.name for path in tmp_path.iterdir()}
    assert "bit-identical to the offline correction" in printed
    model = SensorModel.load(tmp_path / "model.yaml")
    true = SensorModel.load(demo.BAGS / "viscoelastic_bench.yaml").core
    for name in ("natural_frequency_hz", "damping_ratio", "damping_order", "sensitivity"):
        shown, truth = re.search(rf"{name} +(\S.*?)  +true: (\S+)", printed).groups()
        value, known = getattr(model.core, name), model.metadata["uncertainties"][name]
        assert shown == written(value, known["std"], known["unit"])
        assert float(truth) == getattr(true, name)
        assert abs(value - float(truth)) < 4 * known["std"]
    axes = re.findall(r"^  [xyz] +\S+ +(\S+) +(\S+)", printed, re.MULTILINE)
    assert len(axes) == 3
    for before, after in axes:
        assert float(after) < 0.5 < 50 < float(before)


def test_demo_without_a_bag_says_so_in_one_line(tmp_path, capsys):
    assert demo.main(["--bag", str(tmp_path / "none.mcap"), "--output-dir", str(tmp_path)]) == 2
    line, = capsys.readouterr().err.strip().splitlines()
    assert "none.mcap" in line
