"""The example policy has what the nodes ask of DDS, and nobody else may change a model."""

import contextlib
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
POLICY = ElementTree.parse(ROOT / "config" / "sros2_policy.xml").getroot()


def allowed(node, kind, way):
    return {entry.text for profile in POLICY.iter("profile") if profile.get("node") == node
            for group in profile.iter(f"{kind}s") if group.get(way) == "ALLOW"
            for entry in group.iter(kind)}


def named_in(*files):
    text = "".join((ROOT / "frac_accel" / file).read_text() for file in files)
    return set(re.findall(r'"((?:imu|accel)/[a-z_]+)"', text))


def test_the_corrector_may_use_its_topics():
    named = named_in("nodes/_sensor.py", "nodes/_filtered_topic.py")
    assert {"imu/data_raw", "imu/data"} <= named
    may = allowed("corrector", "topic", "subscribe") | allowed("corrector", "topic", "publish")
    assert named <= may
    assert {"diagnostics", "corrector/metrics", "corrector/metrics/*"} <= allowed(
        "corrector", "topic", "publish")
    assert "imu/data_raw" not in allowed("corrector", "topic", "publish")


def test_the_virtual_sensor_may_use_its_topics():
    may = (allowed("virtual_sensor", "topic", "subscribe")
           | allowed("virtual_sensor", "topic", "publish"))
    assert named_in("nodes/virtual_sensor.py") <= may


def test_the_diagnoser_may_use_its_topics_and_services():
    text = (ROOT / "frac_accel" / "nodes" / "diagnoser.py").read_text()
    assert named_in("nodes/diagnoser.py") == {"imu/data_raw", "imu/reference", "imu/third"}
    assert named_in("nodes/diagnoser.py") <= allowed("diagnoser", "topic", "subscribe")
    assert {"diagnostics", "diagnoser/result"} <= allowed("diagnoser", "topic", "publish")
    own = {f"~/{name}" for name in re.findall(r'\("([a-z_]+)", (?:lambda|self\._keeper\.)', text)}
    assert own == {"~/diagnose", "~/apply", "~/roll_back"}
    assert own <= allowed("diagnoser", "service", "reply")
    assert {f"diagnoser/{name[2:]}" for name in own} <= allowed("maintenance", "service", "request")


def test_only_maintenance_and_diagnoser_may_change_a_model():
    asking = {(profile.get("node"), service.text) for profile in POLICY.iter("profile")
              for group in profile.iter("services") if group.get("request") == "ALLOW"
              for service in group.iter("service") if service.text.startswith("corrector/")}
    assert {text for node, text in asking if node != "maintenance"} == {"corrector/set_parameters"}
    assert {node for node, _ in asking} == {"maintenance", "diagnoser"}
    own = set(re.findall(r'"(~/[a-z]+_[a-z]+)"',
                         (ROOT / "frac_accel" / "nodes" / "corrector.py").read_text()))
    assert own == {"~/reload_model", "~/add_sensor", "~/remove_sensor"}
    managed = {"~/change_state", "~/get_state"}
    assert own | managed | {"~/set_parameters"} <= allowed("corrector", "service", "reply")


def test_every_pin_has_a_hash_and_pip_asks_for_them():
    for name in ("venv", "oldest", "docs"):
        text = (ROOT / "requirements" / f"{name}.txt").read_text()
        pins = re.findall(r"^[A-Za-z0-9][^\n]*==[^\n]*(?:\n    --hash=sha256:[0-9a-f]{64}[^\n]*)*",
                          text, re.M)
        assert len(pins) > 20 and all("--hash=sha256:" in pin for pin in pins)
    recipes = [line for line in (ROOT / "Makefile").read_text().splitlines()
               if "pip install" in line and "--editable" not in line]
    assert len(recipes) >= 3 and all("--require-hashes" in line for line in recipes)


@pytest.mark.ros
def test_no_node_asks_for_more_than_its_profile_has(tmp_path):
    """With security on, a node that may not answer its own parameter services does not start."""
    pytest.importorskip("rclpy")
    from ros_probe import Probe
    from ros_processes import NodeProcess, ros_domain
    model = tmp_path / "m.yaml"
    model.write_text("schema: frac_accel/sensor_model/1\n"
                     "core: {natural_frequency_hz: 90.0, damping_ratio: 0.2}\n")
    bag = ROOT / "bags" / "classical_bench.mcap"
    nodes = {"corrector": {"model_file": model, "metrics_topics": True},
             "virtual_sensor": {"model_file": model},
             "diagnoser": {"model_file": model, "results": tmp_path / "results"},
             "recorder": {"bag": tmp_path / "o.mcap", "topics": ["/imu/data"]},
             "player": {"bag": bag, "wait_for_subscribers": 9,
                        "topics": ["/imu/reference", "/imu/data_raw"]}}
    with contextlib.ExitStack() as running:
        environment = running.enter_context(ros_domain())
        probe = running.enter_context(Probe(environment))
        for name, parameters in nodes.items():
            running.enter_context(NodeProcess(name, environment, parameters))
        graph = probe.node
        found = {"topic": {"publish": graph.get_publisher_names_and_types_by_node,
                           "subscribe": graph.get_subscriber_names_and_types_by_node},
                 "service": {"reply": graph.get_service_names_and_types_by_node,
                             "request": graph.get_client_names_and_types_by_node}}
        probe.until(lambda: set(nodes) <= set(graph.get_node_names()), graph.get_node_names)
        probe.until(lambda: all(len(graph.get_service_names_and_types_by_node(name, "/")) >= 7
                                for name in nodes), "no services")
        asked = {(name, kind, way): {entry for entry, _ in ask(name, "/")} for name in nodes
                 for kind, ways in found.items() for way, ask in ways.items()}
    for (name, kind, way), entries in asked.items():
        may = [f"/{rule}".replace("/~", f"/{name}") for rule in allowed(name, kind, way)]
        assert not {entry for entry in entries if not any(
            re.fullmatch(rule.replace("*", ".*"), entry) for rule in may)}, (name, kind, way)
        assert entries or way in ("subscribe", "request"), (name, kind, way)


@pytest.mark.ros
@pytest.mark.parametrize("keys", ["missing", "empty enclave"])
def test_a_node_without_its_keys_ends_and_does_not_run_unsecured(tmp_path, keys):
    pytest.importorskip("rclpy")
    from ros_processes import NodeProcess, ros_domain
    if keys == "empty enclave":
        (tmp_path / "enclaves" / "frac_accel" / "corrector").mkdir(parents=True)
    with ros_domain() as environment:
        secured = {**environment, "ROS_SECURITY_KEYSTORE": str(tmp_path),
                   "ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}
        with NodeProcess("corrector", secured, {}, "--enclave", "/frac_accel/corrector") as node:
            assert node.wait() == 2
    told = [line for line in node.errors if line.startswith("corrector: error: ")]
    assert len(told) == 1 and "secur" in told[0].lower() and "Traceback" not in node.text
