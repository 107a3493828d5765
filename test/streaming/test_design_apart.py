"""Any model file at all is a design or a refusal in one line, in a stated time."""

import os
import time

import numpy as np
import pytest
import yaml

from frac_accel import Corrector
from frac_accel.errors import DesignError, FracAccelError
from frac_accel.model import SensorModel
from frac_accel.streaming import apart
from frac_accel.streaming.apart import design_apart
from frac_accel.streaming.stream import Stream

RATE = 1000.0
GOOD = {"schema": "frac_accel/sensor_model/1",
        "core": {"natural_frequency_hz": 150.0, "damping_ratio": 0.2, "damping_order": 1.4},
        "effects": [{"cause": "ac_coupling", "corner_hz": 1.0},
                    {"cause": "cubic_stiffness", "alpha3": 1e-4}],
        "covariance": {"parameters": ["damping_ratio"], "matrix": [[1e-4]]}}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.yaml"


def test_the_design_is_the_same_to_the_last_bit(path):
    path.write_text(yaml.safe_dump(GOOD))
    model, model_hash, designs = design_apart(path, [RATE], {}, 60.0)
    assert designs[RATE].model is model and len(model_hash) == 64
    rng = np.random.default_rng(0)
    stamps, values = np.arange(2000) * 1_000_000, rng.normal(size=(2000, 3))
    expected = Corrector(SensorModel.from_dict(GOOD), RATE, noise_std=0.1).process(stamps, values)
    other = {**GOOD, "core": {**GOOD["core"], "natural_frequency_hz": 100.0}}
    kernel = Corrector(SensorModel.from_dict(other), RATE, noise_std=0.1)
    kernel.prepare(model, designs[RATE])
    kernel.replace(model)
    result = kernel.process(stamps, values)
    assert result.values.tobytes() == expected.values.tobytes()
    assert result.variance.tobytes() == expected.variance.tobytes()


@pytest.mark.parametrize("text", [
    "core: {natural_frequency_hz: 1e308, damping_ratio: 1e-300}",
    "core: {natural_frequency_hz: 1, damping_ratio: 0.1}\n"
    "effects: [{cause: hysteresis, strength: 1e200, beta: 1e200, gamma: -1e200}]",
    "core: {natural_frequency_hz: 150, damping_ratio: 0.1}\n"
    "effects: [{cause: cubic_stiffness, alpha3: 1e308}, "
    "{cause: quadratic_stiffness, alpha2: 1e308}]",
    "core: {type: arx, numerator: [1e300, -1e300], denominator: [1, 0.5], sampling_rate_hz: 1}",
    "noise_std: 0x" + "f" * 6000,
    "[" * 60_000,
])
def test_whatever_it_says_is_a_design_or_one_line(path, text):
    path.write_text(f"schema: frac_accel/sensor_model/1\n{text}\n")
    try:
        _, _, designs = design_apart(path, [RATE], {}, 60.0)
        assert designs[RATE].warm_up_samples > 0
    except FracAccelError as error:
        assert "\n" not in str(error) and len(str(error)) < 600


def test_a_fifo_is_refused_at_once(path):
    os.mkfifo(path)
    with pytest.raises(FracAccelError, match="not a regular file"):
        design_apart(path, [RATE], {}, 60.0)


def test_it_is_given_up_in_time(path, monkeypatch):
    """The same program, but it takes for ever: the process is ended, none is left."""
    path.write_text(yaml.safe_dump(GOOD))
    slow = path.with_name("slow.py")
    slow.write_text("import time\ntime.sleep(60)\n")
    monkeypatch.setenv("PYTHONPATH", str(path.parent))
    monkeypatch.syspath_prepend(str(path.parent))
    monkeypatch.setattr(apart, "__name__", "slow")
    before = time.monotonic()
    with pytest.raises(DesignError, match="took longer than 0.5 s"):
        design_apart(path, [RATE], {}, 0.5)
    assert time.monotonic() - before < 5.0


def test_an_unforeseen_error_of_the_design_is_a_refusal(monkeypatch):
    kernel = Corrector(SensorModel.from_dict(GOOD), RATE)
    before = kernel.design

    def fails(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(Corrector, "_design", fails)
    assert issubclass(Corrector, Stream)
    for change in (kernel.prepare, kernel.replace):
        with pytest.raises(DesignError, match="LinAlgError"):
            change(SensorModel.from_dict(GOOD))
    assert kernel.design is before
