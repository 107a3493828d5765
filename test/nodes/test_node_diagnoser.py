"""Node ``diagnoser`` beside a corrector: a change on the way, and another model in the end."""

import json
import time

import pytest

pytest.importorskip("rclpy")

from monitoring_rig import MODEL, ChangingDrive
from rcl_interfaces.srv import GetParameters
from ros_probe import Probe
from ros_processes import NodeProcess, ros_domain

from frac_accel.io.bag import RAW_TOPIC, REFERENCE_TOPIC, write_bag
from frac_accel.model import SensorModel

pytestmark = pytest.mark.ros

EFFECT = {"sensitivity_error": {"gain": 1.1}}
FASTER = 10.0


def played(environment, path, drive, later_s=0):
    """Play a drive, many times faster than it was."""
    write_bag(path, {topic: samples._replace(stamps_ns=samples.stamps_ns + later_s * 10**9)
                     for topic, samples in zip((REFERENCE_TOPIC, RAW_TOPIC), drive.samples())})
    with NodeProcess("player", environment, {
            "bag": path, "rate": FASTER, "wait_for_subscribers": 2,
            "start_delay_s": 1.0}) as player:
        assert player.wait(180) == 0, player.text


def model_file_of(probe):
    client = probe.node.create_client(GetParameters, "/corrector/get_parameters")
    assert client.wait_for_service(10)
    future = client.call_async(GetParameters.Request(names=["model_file"]))
    probe.until(future.done, "no answer")
    return future.result().values[0].string_value


def test_a_change_is_told_and_its_model_applied_and_taken_back(tmp_path):
    model = tmp_path / "model.yaml"
    model.write_text(json.dumps(MODEL))
    with ros_domain() as environment, Probe(environment) as probe, \
            NodeProcess("corrector", environment, {"model_file": model}) as corrector, \
            NodeProcess("diagnoser", environment, {
                "model_file": model, "results": tmp_path / "results", "apply": "confirmed",
                "false_alarm_h": 1.0, "budget": 1.0, "niceness": 0,
                "time_limit_s": 20.0}) as node:
        node.wait_for("watches axis x", 60)
        told = probe.metrics("/diagnoser/result")
        played(environment, tmp_path / "first.mcap",
               ChangingDrive(11, EFFECT, 250.0, duration_s=330.0))
        node.wait_for('"step": "diagnosed"', 180)
        probe.until(lambda: told, "no result was published")
        assert model_file_of(probe) == str(model)
        played(environment, tmp_path / "second.mcap",
               ChangingDrive(12, EFFECT, duration_s=120.0), 400)
        node.wait_for('"step": "applied"', 60)
        corrector.wait_for("is in use", 30)
        extended = model_file_of(probe)
        # a busy machine loses messages on the way: that is in the record, too, and is named
        [effect] = (effect for effect in SensorModel.load(extended).axis("x").effects
                    if effect.cause != "dropped_samples")
        assert effect.cause == "sensitivity_error" and effect.gain == pytest.approx(1.1, abs=0.01)

        def said():
            """What it has said of its model, each time."""
            return [{pair.key: pair.value for pair in status.values}
                    for status in list(probe.statuses) if status.name == "diagnoser: model"]
        # it says so a second later
        probe.until(lambda: said()[-1]["model_file"] == extended
                    and said()[-1]["state"] == "learning", said)
        assert any("sensitivity_error" in values.get("causes", "") for values in said())
        assert probe.trigger("/diagnoser/roll_back").success
        node.wait_for('"step": "rolled back"', 30)
        deadline = time.monotonic() + 20
        while model_file_of(probe) != str(model):
            assert time.monotonic() < deadline
        assert node.stop() == 0, node.text


@pytest.mark.parametrize("parameters, words", [
    ({}, "'model_file' is missing"), ({"model_file": "nowhere.yaml"}, "nowhere.yaml"),
    ({"apply": "always"}, "'apply' must be never or confirmed"),
    ({"axis": "u"}, "'axis' must be x, y or z")])
def test_what_it_cannot_start_with_is_one_line(tmp_path, parameters, words):
    model = tmp_path / "model.yaml"
    model.write_text(json.dumps(MODEL))
    if parameters and "model_file" not in parameters:
        parameters = {**parameters, "model_file": model}
    with ros_domain() as environment, \
            NodeProcess("diagnoser", environment, {**parameters, "results": tmp_path}) as node:
        assert node.wait() == 2
        assert any(words in line for line in node.errors), node.text
