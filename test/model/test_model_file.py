"""Model files: what is written is read again, and what is wrong is named with field and value."""

import dataclasses
import importlib.metadata
import os
import stat

import numpy as np
import pytest
import yaml
from random_models import draw_sensor, model_of

from frac_accel.errors import ModelError
from frac_accel.model import SensorModel
from frac_accel.model import effects as effects_package
from frac_accel.model.effects.base import CONDITIONER, Effect
from frac_accel.model.parameters import parameter

SCHEMA = "frac_accel/sensor_model/1"


def data_of(**changes):
    data = {"schema": SCHEMA, "core": {"natural_frequency_hz": 180.0, "damping_ratio": 0.15}}
    data.update(changes)
    return {key: value for key, value in data.items() if value is not ...}


def core_of(**changes):
    core = {"natural_frequency_hz": 180.0, "damping_ratio": 0.15}
    core.update(changes)
    return data_of(core={key: value for key, value in core.items() if value is not ...})


def arx_of(**changes):
    return data_of(core={"type": "arx", "numerator": [0.5], "denominator": [1.0, -0.5],
                         "sampling_rate_hz": 1000.0, **changes})


def fractional_of(**changes):
    return data_of(core={"type": "fractional_transfer_function",
                         "denominator_coefficients": [1e-6, 1e-3, 1.0],
                         "denominator_orders": [2.0, 0.8, 0.0],
                         "numerator_coefficients": [1.0], "numerator_orders": [0.0], **changes})


def effect_of(**parameters):
    return data_of(effects=[parameters])


@pytest.mark.parametrize("seed", range(20))
def test_round_trip_of_random_models(seed, tmp_path):
    rng = np.random.default_rng(seed)
    model = model_of(draw_sensor(rng, 2000.0, own_axes=0.6, share=0.5))
    model.metadata.update(noise_std=0.01, provenance={"bag": "a.mcap"}, note="größer")
    path = tmp_path / "model.yaml"
    model.save(path)
    again = SensorModel.load(path)
    assert again.to_dict() == model.to_dict()
    assert again.axes == model.axes
    assert again.metadata == model.metadata
    frequency = np.geomspace(1, 900, 50)
    for axis in "xyz":
        np.testing.assert_array_equal(again.frequency_response(frequency, axis),
                                      model.frequency_response(frequency, axis))


def test_written_file_is_plain_yaml_with_the_permissions_of_any_file(tmp_path):
    path = tmp_path / "model.yaml"
    SensorModel.from_dict(data_of()).save(path)
    assert yaml.safe_load(path.read_text())["schema"] == SCHEMA
    plain = tmp_path / "plain"
    plain.touch()
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)
    assert sorted(os.listdir(tmp_path)) == ["model.yaml", "plain"]


def test_failed_write_leaves_nothing_behind(tmp_path):
    (tmp_path / "taken").mkdir()
    with pytest.raises(ModelError, match="cannot write"):
        SensorModel.from_dict(data_of()).save(tmp_path / "taken")
    assert os.listdir(tmp_path) == ["taken"]
    with pytest.raises(ModelError, match="cannot write"):
        SensorModel.from_dict(data_of()).save(tmp_path / "no" / "folder.yaml")


def test_numpy_numbers_in_metadata_are_written(tmp_path):
    model = SensorModel.from_dict(data_of())
    model.metadata["uncertainties"] = {"damping_ratio": np.float64(0.001)}
    model.metadata["band_hz"] = np.array([1.0, 2.0])
    model.save(tmp_path / "model.yaml")
    again = SensorModel.load(tmp_path / "model.yaml")
    assert again.metadata == {"uncertainties": {"damping_ratio": 0.001}, "band_hz": [1.0, 2.0]}


def test_minimal_file_of_the_design(tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text("""
schema: frac_accel/sensor_model/1
core:
  type: oscillator              # the default
  natural_frequency_hz: 180.0
  damping_ratio: 1.5e-1
  damping_order: 1.0
  sensitivity: 1e0
effects:
  - {cause: time_delay, delay_s: 6e-4}
""")
    model = SensorModel.load(path)
    assert model.axes[2].effective_core.damping_ratio == 0.15
    assert model.axes[0].delay_s == 6e-4


def test_axes_override_core_and_effects_separately():
    model = SensorModel.from_dict(data_of(
        effects=[{"cause": "offset", "offset": 1.0}],
        axes={"y": {"core": {"natural_frequency_hz": 90.0, "damping_ratio": 0.3}},
              "z": {"effects": []}}))
    assert [axis.core.natural_frequency_hz for axis in model.axes] == [180.0, 90.0, 180.0]
    assert [len(axis.effects) for axis in model.axes] == [1, 1, 0]


def test_three_axes_without_a_common_core():
    core = {"natural_frequency_hz": 180.0, "damping_ratio": 0.15}
    model = SensorModel.from_dict(data_of(core=..., axes={a: {"core": core} for a in "xyz"}))
    assert SensorModel.from_dict(model.to_dict()).axes == model.axes


BAD = [
    # the file as a whole
    (None, ["model", "nothing given", "mapping"]),
    ([1], ["model", "a list given", "mapping"]),
    ("text", ["model", "a str given"]),
    ({}, ["schema", "nothing given", SCHEMA]),
    (data_of(schema="frac_accel/sensor_model/2"), ["schema", "sensor_model/2", SCHEMA]),
    (data_of(schema=1), ["schema", "something else given"]),
    (data_of(core=...), ["core", "missing"]),
    (data_of(core=None), ["core", "nothing given", "mapping"]),
    (data_of(core=[180, 0.15]), ["core", "[180, 0.15] given", "mapping"]),
    (data_of(cores={}), ["cores", "did you mean 'core'"]),
    (data_of(effect=[]), ["effect", "did you mean 'effects'"]),
    ({**data_of(), 5: 1}, ["key 5", "expected text"]),
    # the core
    (core_of(type="ocillator"), ["core.type", "'ocillator' given", "oscillator"]),
    (core_of(type=["arx"]), ["core.type", "['arx'] given", "oscillator"]),
    (core_of(type={}), ["core.type", "{} given"]),
    (core_of(natural_frequency_hz=-180.0), ["core.natural_frequency_hz", "-180 given", "above 0"]),
    (core_of(natural_frequency_hz=0), ["core.natural_frequency_hz", "0 given", "above 0"]),
    (core_of(natural_frequency_hz=1e12), ["core.natural_frequency_hz", "1e+12 given"]),
    (core_of(natural_frequency_hz=float("nan")), ["core.natural_frequency_hz", "nan given", "Hz"]),
    (core_of(natural_frequency_hz=float("inf")), ["core.natural_frequency_hz", "inf given"]),
    (core_of(natural_frequency_hz=True), ["core.natural_frequency_hz", "True given"]),
    (core_of(natural_frequency_hz=None), ["core.natural_frequency_hz", "None given"]),
    (core_of(natural_frequency_hz="180 Hz"), ["core.natural_frequency_hz", "'180 Hz' given",
                                              "a number in Hz"]),
    (core_of(natural_frequency_hz="fast"), ["core.natural_frequency_hz", "'fast' given"]),
    (core_of(natural_frequency_hz=[180]), ["core.natural_frequency_hz", "[180] given"]),
    (core_of(natural_frequency_hz=...), ["core.natural_frequency_hz", "missing", "Hz"]),
    (core_of(natural_frequency_hz=10**400), ["core.natural_frequency_hz", "given"]),
    (core_of(natural_frequency=180), ["core.natural_frequency", "did you mean",
                                      "natural_frequency_hz"]),
    (core_of(damping_ratio=0), ["core.damping_ratio", "0 given", "above 0"]),
    (core_of(damping_ratio=-0.1), ["core.damping_ratio", "-0.1 given"]),
    (core_of(damping_order=2), ["core.damping_order", "2 given", "below 2"]),
    (core_of(damping_order=0), ["core.damping_order", "0 given", "above 0"]),
    (core_of(sensitivity="high"), ["core.sensitivity", "'high' given"]),
    # arx
    (arx_of(denominator=[1.0, -1.1]), ["core.denominator", "unstable", "1.1"]),
    (arx_of(denominator=[1.0, -1.0]), ["core.denominator", "unstable"]),
    (arx_of(denominator=[0.0, 1.0]), ["core.denominator[0]", "0 given"]),
    (arx_of(denominator=[]), ["core.denominator", "[] given", "list of numbers"]),
    (arx_of(denominator=1.0), ["core.denominator", "1.0 given", "list of numbers"]),
    (arx_of(denominator=[1.0, "x"]), ["core.denominator[1]", "'x' given"]),
    (arx_of(denominator=[1.0, float("nan")]), ["core.denominator[1]", "nan given"]),
    (arx_of(numerator=[0.0]), ["core.numerator", "only zeros"]),
    (arx_of(numerator=[1.0, 2.0, 3.0]), ["core.numerator", "3 coefficients", "at most"]),
    (arx_of(sampling_rate_hz=0), ["core.sampling_rate_hz", "0 given"]),
    (arx_of(sampling_rate_hz=None), ["core.sampling_rate_hz", "None given", "Hz"]),
    (data_of(core={"type": "arx", "numerator": [0.5], "denominator": [1.0, -0.5]}),
     ["core.sampling_rate_hz", "missing", "Hz"]),
    # coefficients in z for an equation in s
    (arx_of(type="fractional_transfer_function"), ["core.numerator", "in z", "type: arx"]),
    (fractional_of(sampling_rate_hz=1000.0), ["core.sampling_rate_hz", "in z", "type: arx"]),
    (core_of(denominator=[1.0, -0.5]), ["core.denominator", "oscillator", "in z", "type: arx"]),
    # fractional transfer function
    (fractional_of(denominator_coefficients=[1e-6, -1e-3, 1.0]),
     ["core.denominator_coefficients", "unstable"]),
    (fractional_of(denominator_orders=[3.5, 0.8, 0.0]), ["unstable"]),
    (fractional_of(denominator_orders=[2.0, 0.8]), ["core.denominator_orders", "2 given", "3"]),
    (fractional_of(denominator_orders=[2.0, 0.8, 0.8]), ["core.denominator_orders", "different"]),
    (fractional_of(denominator_orders=[2.0, 0.8, -1.0]), ["core.denominator_orders", "at least 0"]),
    (fractional_of(numerator_coefficients=[0.0]), ["core.numerator_coefficients", "only zeros"]),
    # effects
    (data_of(effects={"cause": "offset"}), ["effects", "given", "list"]),
    (data_of(effects="offset"), ["effects", "'offset' given", "list"]),
    (data_of(effects=["offset"]), ["effects[0]", "'offset' given", "mapping"]),
    (data_of(effects=[None]), ["effects[0]", "nothing given", "mapping"]),
    (effect_of(delay_s=1.0), ["effects[0].cause", "unknown cause None", "docs/effects.md"]),
    (effect_of(cause="time_dela", delay_s=1.0), ["effects[0].cause", "'time_dela'",
                                                 "did you mean 'time_delay'"]),
    (effect_of(cause=["offset"], offset=1.0), ["effects[0].cause", "['offset']"]),
    (effect_of(cause={}, offset=1.0), ["effects[0].cause", "{}"]),
    (effect_of(cause="time_delay"), ["effects[0].delay_s", "missing", "a number in s"]),
    (effect_of(cause="time_delay", delay=1.0), ["effects[0].delay", "did you mean 'delay_s'"]),
    (effect_of(cause="time_delay", delay_s=600), ["effects[0].delay_s", "600 given", "at most 10"]),
    (effect_of(cause="time_delay", delay_s="0.6 ms"), ["effects[0].delay_s", "'0.6 ms' given"]),
    (effect_of(cause="ac_coupling", corner_hz=-1), ["effects[0].corner_hz", "-1 given", "above 0"]),
    (effect_of(cause="low_pass_lag", corner_hz=0), ["effects[0].corner_hz", "0 given"]),
    (effect_of(cause="mounting_resonance", frequency_hz=90), ["effects[0].damping_ratio",
                                                              "missing"]),
    (effect_of(cause="cross_axis_sensitivity", x=3), ["effects[0].x", "3 given", "at most 1"]),
    (effect_of(cause="fractional_damping", damping_order=2.5, damping_ratio=0.1),
     ["effects[0].damping_order", "2.5 given", "below 2"]),
    (data_of(effects=[{"cause": "offset", "offset": 1.0}] * 2), ["offset given 2 times", "once"]),
    (arx_of() | {"effects": [{"cause": "fractional_damping", "damping_order": 0.5,
                              "damping_ratio": 0.1}]}, ["fractional_damping", "arx", "oscillator"]),
    # axes
    (data_of(axes=[1]), ["axes", "[1] given", "mapping"]),
    (data_of(axes={"w": {}}), ["axes.w", "expected x, y or z"]),
    (data_of(axes={"xy": {}}), ["axes.xy", "expected x, y or z"]),
    (data_of(axes={1: {}}), ["axes.1", "expected x, y or z"]),
    (data_of(axes={"x": None}), ["axes.x", "nothing given", "mapping"]),
    (data_of(axes={"x": {"cores": {}}}), ["axes.x.cores", "core or effects"]),
    (data_of(axes={"x": {"core": {"natural_frequency_hz": -1, "damping_ratio": 1}}}),
     ["axes.x.core.natural_frequency_hz", "-1 given"]),
    (data_of(axes={"y": {"core": arx_of(denominator=[1, -2])["core"]}}),
     ["axes.y.core.denominator", "unstable"]),
    (data_of(core=..., axes={"x": {"core": {"natural_frequency_hz": 1, "damping_ratio": 1}}}),
     ["core", "missing"]),
    # further keys with a meaning
    (data_of(noise_std=-1), ["noise_std", "-1 given"]),
    (data_of(noise_std="loud"), ["noise_std", "'loud' given"]),
]


@pytest.mark.parametrize("data, words", BAD, ids=[words[0] + str(i)
                                                  for i, (_, words) in enumerate(BAD)])
def test_bad_model_is_refused_in_one_line_that_names_it(data, words):
    with pytest.raises(ModelError) as caught:
        SensorModel.from_dict(data, where="model.yaml")
    message = str(caught.value)
    assert message.startswith("model.yaml: ")
    assert "\n" not in message and len(message) < 500
    for word in words:
        assert word in message


TEXTS = {
    "broken YAML": ("core: [1, 2", "not valid YAML"),
    "tab": ("core:\n\tnatural_frequency_hz: 1", "not valid YAML"),
    "duplicate key": (f"schema: {SCHEMA}\ncore: {{natural_frequency_hz: 1, damping_ratio: 1, "
                      "damping_ratio: 2}\n", "'damping_ratio' stands twice"),
    "duplicate at the top": (f"schema: {SCHEMA}\nschema: {SCHEMA}\n", "'schema' stands twice"),
    "alias": ("a: &a [1]\nb: *a\n", "alias"),
    "billion laughs": ("a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n", "alias"),
    "merge": (f"schema: {SCHEMA}\nbase: &b {{x: 1}}\ncore: {{<<: *b}}\n", "alias"),
    "python object": ("core: !!python/object/apply:os.system [ls]", "not valid YAML"),
    "two documents": ("a: 1\n---\nb: 2\n", "not valid YAML"),
    "deep nesting": ("[" * 5000 + "]" * 5000, "not valid YAML"),
    "unhashable key": ("? [1, 2]\n: 3\n", "not valid YAML"),
    "mapping as key": ("? {a: 1}\n: 3\n", "not valid YAML"),
    "control character": ("a: \x07", "not valid YAML"),
    "impossible date": ("a: 2024-99-99", "not valid YAML"),
    "base 60": (f"schema: {SCHEMA}\nnoise_std: " + "1:" * 20_000 + "1", "number with colons"),
    "base 60, broken": ("a: 1:30.5", "number with colons"),
    "huge hexadecimal": (f"schema: {SCHEMA}\nseed: 0x" + "f" * 6000, "more than 40 digits"),
    "huge decimal": ("a: " + "9" * 60_000, "more than 40 digits"),
    "a tag that makes nothing": ("a: !!timestamp x", "a tag"),
    "a number that is none": ("a: 0b_", "not valid YAML"),
    "empty": ("", "nothing given"),
    "only a comment": ("# nothing\n", "nothing given"),
}


@pytest.mark.parametrize("name", TEXTS)
def test_bad_text_is_refused_with_the_file(name, tmp_path):
    text, word = TEXTS[name]
    path = tmp_path / "model.yaml"
    path.write_text(text)
    with pytest.raises(ModelError) as caught:
        SensorModel.load(path)
    message = str(caught.value)
    assert str(path) in message and word in message
    assert "\n" not in message and len(message) < 500


SECRETS = {
    "passwd": "root:x:0:0:root:/root:/bin/bash\n",
    "environment": "db_password=hunter2\n",
    "yaml": "schema: hunter2\ndb_password: hunter2\n",
    "twins": "hunter2: 1\nhunter2: 2\n",
    "list": "- hunter2\n",
    "broken": "hunter2: [*hunter2, %hunter2, `hunter2\n",
    "tag": "a: !hunter2 b\n",
    "escape": 'a: "\\qhunter2"\n',
    "directive": "%hunter2 x\n---\na: 1\n",
    "model elsewhere": "hunter2: 'schema: frac_accel/sensor_model/1'\n",
    "schema alone": "frac_accel/sensor_model/1: hunter2",
    "almost a schema": "schema: frac_accel/sensor_model/hunter2",
}


@pytest.mark.parametrize("name", SECRETS)
def test_nothing_is_quoted_of_a_file_that_is_no_model(name, tmp_path):
    path = tmp_path / "model.yaml"
    path.write_text(SECRETS[name])
    with pytest.raises(ModelError) as caught:
        SensorModel.load(path)
    message = str(caught.value).replace(str(path), "")
    for word in ("hunter2", "root", "db_password", "q"):
        assert word not in message.replace("expected", "")


def test_a_long_value_is_quoted_in_part():
    with pytest.raises(ModelError) as caught:
        SensorModel.from_dict(data_of(noise_std="x" * 10**6))
    assert len(str(caught.value)) < 200


def test_files_that_are_none(tmp_path):
    with pytest.raises(ModelError, match="No such file"):
        SensorModel.load(tmp_path / "missing.yaml")
    with pytest.raises(ModelError, match="directory"):
        SensorModel.load(tmp_path)
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\x89MCAP0\r\n\xff\xfe\x00")
    with pytest.raises(ModelError, match="not a text file"):
        SensorModel.load(binary)
    huge = tmp_path / "huge.yaml"
    with open(huge, "wb") as file:
        file.truncate(50_000_000)
    with pytest.raises(ModelError, match="larger than 64 KB"):
        SensorModel.load(huge)
    fifo = tmp_path / "fifo.yaml"
    os.mkfifo(fifo)
    for special in (fifo, "/dev/zero", "/dev/null"):
        with pytest.raises(ModelError, match="not a regular file"):
            SensorModel.load(special)
    with pytest.raises(ModelError, match="null byte"):
        SensorModel.load(str(tmp_path / "a\0b"))


@dataclasses.dataclass(frozen=True)
class Halving(Effect):
    """A third party's effect."""

    cause = "halving"
    stage = CONDITIONER
    explanation = "The conditioner halves the signal."

    share: float = parameter("1", above=0)

    def transfer_function(self, s):
        return np.full_like(s, self.share, dtype=complex)


def test_third_party_effect_through_the_entry_point_group(monkeypatch):
    entry = importlib.metadata.EntryPoint("halving", f"{__name__}:Halving", "frac_accel.effects")
    monkeypatch.setattr(effects_package, "entry_points", lambda group: [entry])
    effects_package.forget_extensions()
    try:
        model = SensorModel.from_dict(effect_of(cause="halving", share=0.5))
        assert type(model.effects[0]).__name__ == "Halving"
        assert abs(model.frequency_response(1e-3)) == pytest.approx(0.5)
        assert SensorModel.from_dict(model.to_dict()).axes == model.axes
    finally:
        effects_package.forget_extensions()


def test_a_broken_extension_is_named_and_does_no_other_harm(monkeypatch):
    entry = importlib.metadata.EntryPoint("gone", "no_such_module:Gone", "frac_accel.effects")
    monkeypatch.setattr(effects_package, "entry_points", lambda group: [entry])
    effects_package.forget_extensions()
    try:
        assert SensorModel.from_dict(effect_of(cause="offset", offset=1.0)).effects
        with pytest.raises(ModelError, match="gone.*no_such_module"):
            SensorModel.from_dict(effect_of(cause="gone"))
        assert "no_such_module" in effects_package.broken_extensions()["gone"]
        assert "gone" not in effects_package.known_effects()
    finally:
        effects_package.forget_extensions()
