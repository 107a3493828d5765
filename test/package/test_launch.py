"""What the launch files describe, where launch itself is not installed: with classes that record.

On a machine with ROS `test_packaging` makes the descriptions of launch itself.
"""

import importlib.abc
import importlib.machinery
import runpy
import sys
import types
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


class Recorded:
    """A call: the name of the class, and what it was given."""

    def __init__(self, *arguments, **keywords):
        self.arguments, self.keywords = arguments, keywords


class _Modules(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Modules of launch whose every name is a class that records."""

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("launch", "launch_ros"):
            return importlib.machinery.ModuleSpec(name, self, is_package=True)
        return None

    def create_module(self, spec):
        module = types.ModuleType(spec.name)
        module.__getattr__ = lambda name: (
            self.matches if name == "matches_action" else type(name, (Recorded,), {}))
        return module

    def exec_module(self, module):
        module.__path__ = []

    @staticmethod
    def matches(action):
        return action


def entities(name, monkeypatch):
    """Entities of a description, by the name of their class."""
    monkeypatch.setattr(sys, "meta_path", [_Modules(), *sys.meta_path])
    for module in [key for key in sys.modules if key.partition(".")[0] in ("launch", "launch_ros")]:
        monkeypatch.delitem(sys.modules, module)
    try:
        description = runpy.run_path(ROOT / "launch" / name)["generate_launch_description"]()
    finally:
        for module in [key for key in sys.modules
                       if key.partition(".")[0] in ("launch", "launch_ros")]:
            del sys.modules[module]
    found = {}
    for entity in description.arguments[0]:
        found.setdefault(type(entity).__name__, []).append(entity)
    return found


def handlers(found, name):
    """The event handlers of a class."""
    return [handler.arguments[0] for handler in found["RegisterEventHandler"]
            if type(handler.arguments[0]).__name__ == name]


def exit_handler(found):
    """What the only handler of a process's end is called with, and its action."""
    on_process_exit, = handlers(found, "OnProcessExit")
    return on_process_exit.keywords["on_exit"], on_process_exit.keywords["target_action"]


@pytest.mark.parametrize("name, kind", [("vehicle", "Node"), ("managed", "LifecycleNode"),
                                        ("diagnoser", "Node")])
def test_what_cannot_run_is_not_started_again(name, kind, monkeypatch):
    found = entities(f"{name}.launch.py", monkeypatch)
    on_exit, action = exit_handler(found)
    assert action is found[kind][0] and action.keywords["respawn"] is True
    for status in (0, 1, -6, -9):
        assert on_exit(types.SimpleNamespace(returncode=status), None) is None
    event = on_exit(types.SimpleNamespace(returncode=2), None)[-1].keywords["event"]
    assert type(event).__name__ == "ShutdownProcess"
    assert event.keywords["process_matcher"] is action


def test_the_managed_corrector_is_configured_and_then_activated(monkeypatch):
    """By the events that `test_node_managed` sees the node send."""
    from lifecycle_msgs.msg import Transition
    found = entities("managed.launch.py", monkeypatch)
    node, = found["LifecycleNode"]
    assert node.keywords["executable"] == "managed_corrector"
    started, = handlers(found, "OnProcessStart")
    configured, = handlers(found, "OnStateTransition")
    assert started.keywords["target_action"] is node
    assert configured.keywords["target_lifecycle_node"] is node
    assert (configured.keywords["start_state"], configured.keywords["goal_state"]) == (
        "configuring", "inactive")
    for asked, transition in ((started.keywords["on_start"], Transition.TRANSITION_CONFIGURE),
                              (configured.keywords["entities"], Transition.TRANSITION_ACTIVATE)):
        event = asked[0].keywords["event"]
        assert type(event).__name__ == "ChangeState"
        assert event.keywords == {"lifecycle_node_matcher": node, "transition_id": transition}
        assert asked[0].keywords["condition"].arguments[0].arguments == ("autostart",)


def test_the_diagnoser_has_its_own_parameters_and_watches_what_the_corrector_reads(monkeypatch):
    found = entities("diagnoser.launch.py", monkeypatch)
    node, = found["Node"]
    assert node.keywords["executable"] == "diagnoser"
    assert {"model_file", "results", "axis", "corrector"} <= node.keywords["parameters"][1].keys()
    assert [name for name, _ in node.keywords["remappings"]] == ["imu/data_raw", "imu/reference"]
    defaults = {each.arguments[0]: each.keywords.get("default_value")
                for each in found["DeclareLaunchArgument"]}
    assert defaults["raw_topic"] == "imu/data_raw" and "model_file" in defaults
    assert defaults["params_file"].arguments[0][1:] == ["config", "diagnoser.yaml"]


def test_a_bag_that_was_not_played_is_no_success(monkeypatch):
    on_exit, action = exit_handler(entities("bench.launch.py", monkeypatch))
    assert action.keywords["executable"] == "player"
    with pytest.raises(RuntimeError, match="exit status 2"):
        on_exit(types.SimpleNamespace(returncode=2), None)
    timer, = on_exit(types.SimpleNamespace(returncode=0), None)
    assert type(timer.keywords["actions"][0]).__name__ == "Shutdown"


def test_the_orientation_filter_reads_what_the_corrector_writes(monkeypatch):
    found = entities("imu_filter.launch.py", monkeypatch)
    included, = found["IncludeLaunchDescription"]
    given = dict(included.keywords["launch_arguments"])
    declared = {each.arguments[0] for each in entities(
        "vehicle.launch.py", monkeypatch)["DeclareLaunchArgument"]}
    assert given.keys() <= declared
    filter_node, = found["Node"]
    assert dict(filter_node.keywords["remappings"]) == {"imu/data_raw": given["corrected_topic"]}
    assert given["corrected_topic"] not in ("imu/data_raw", "imu/data")
    assert "raw_topic" not in given
