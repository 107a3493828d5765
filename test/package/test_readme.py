"""Every example of the pages runs, and prints what the page shows."""

import os
import re

import numpy as np
import pytest
import readme_examples
from ros_processes import ros_domain

from frac_accel import SensorModel, read_bag
from frac_accel.streaming import Corrector


def examples(page):
    return [pair for block in readme_examples.blocks("console", page)
            for pair in readme_examples.commands(block)]


def test_there_are_examples():
    assert sum(len(examples(page)) for page in readme_examples.PAGES) >= 15


@pytest.mark.parametrize("page", [*filter(examples, readme_examples.PAGES)], ids=lambda p: p.stem)
def test_console_examples(page, tmp_path):
    for command, shown in examples(page):
        printed = readme_examples.run(command, tmp_path)
        assert readme_examples.same(shown, printed), f"$ {command}\n{printed}"


PYTHON = readme_examples.ROOT / "docs" / "how_to" / "python.md"


def test_python_examples(tmp_path, monkeypatch, capsys):
    (tmp_path / "bags").symlink_to(readme_examples.ROOT / "bags")
    monkeypatch.chdir(tmp_path)
    for block in readme_examples.blocks("python", PYTHON):
        exec(block, {})
    assert re.match(r"3\d\d\d samples, noise gain \d\.\d\d", capsys.readouterr().out)


@pytest.mark.ros
def test_live_example(tmp_path):
    script, = [block for block in readme_examples.blocks("sh", readme_examples.README)
               if "ros2 run" in block]
    with ros_domain() as environment:
        # the corrector would run for ever: it ends with the recorder
        output = readme_examples.run(
            f"{script}\nwait %1; kill -INT %2; wait", tmp_path,
            env={**os.environ, **environment, "PYTHONPATH": str(readme_examples.ROOT)})
    recorded = read_bag(tmp_path / "drive.mcap")["/imu/data"]
    raw = read_bag(readme_examples.ROOT / "bags" / "fractional_bench.mcap")["/imu/data_raw"]
    model = SensorModel.load(readme_examples.ROOT / "bags" / "fractional_bench.yaml")
    expected = Corrector(model).process(raw.stamps_ns, raw.values, raw.variance)
    assert len(recorded.stamps_ns) > 0.9 * len(expected), output
    # sensor-data QoS may lose a sample; what has arrived is the same to the last bit
    place = np.searchsorted(expected.stamps_ns, recorded.stamps_ns)
    whole = len(recorded.stamps_ns) == len(expected)
    assert not whole or np.array_equal(recorded.values, expected.values[place])
