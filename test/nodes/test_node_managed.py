"""The managed corrector: states by services as of any lifecycle node; and nodes beside others."""

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from ros_probe import Probe, background, publish
from ros_processes import NodeProcess, ros_domain
from sensor_msgs.msg import Imu
from test_node_sensors import (
    RATE_HZ,
    expected,
    parameters_file,
    reliable,
    samples,
    write_model,
)

from frac_accel.io import cdr
from frac_accel.nodes.corrector import Corrector

pytestmark = pytest.mark.ros


def state(probe):
    client = probe.node.create_client(GetState, "/corrector/get_state")
    return probe._call(client, GetState.Request()).current_state.label


IDS = {"configure": Transition.TRANSITION_CONFIGURE, "activate": Transition.TRANSITION_ACTIVATE,
       "deactivate": Transition.TRANSITION_DEACTIVATE, "cleanup": Transition.TRANSITION_CLEANUP,
       "shutdown": Transition.TRANSITION_UNCONFIGURED_SHUTDOWN}


def change(probe, name):
    """Whether a transition was done; by its number, as lifecycle managers ask for it."""
    client = probe.node.create_client(ChangeState, "/corrector/change_state")
    return probe._call(client, ChangeState.Request(transition=Transition(id=IDS[name]))).success


def live(probe, node, model, raw, received):
    """Configure, activate, deactivate and clean up, with messages in each state."""
    del received[:]
    assert change(probe, "configure") and state(probe) == "inactive"
    publisher = probe.publisher(Imu, "/imu/data_raw")
    messages = cdr.encode_samples(cdr.IMU, raw)
    third = len(messages) // 3
    publish([(publisher, messages[:third])], 4 * RATE_HZ)
    probe.status("inactive: nothing is published until it is activated")
    assert not received
    assert change(probe, "activate") and state(probe) == "active"
    publish([(publisher, messages[third:2 * third])], 4 * RATE_HZ)
    probe.until(lambda: received[third // 2:], "too few were corrected")
    assert change(probe, "deactivate")
    count = len(received)
    publish([(publisher, messages[2 * third:])], 4 * RATE_HZ)
    probe.status("inactive")
    assert len(received) == count
    # one filter that has run since it was configured
    corrected = cdr.read_samples(cdr.IMU, received)
    reference = expected(model, raw)
    place = np.searchsorted(reference.stamps_ns, corrected.stamps_ns)
    np.testing.assert_array_equal(corrected.values, reference.values[place])
    assert corrected.stamps_ns[0] < raw.stamps_ns[third] + 10**8
    assert change(probe, "cleanup") and state(probe) == "unconfigured"
    assert "withheld" in node.wait_for("/imu/data_raw: samples")
    probe.until(lambda: not probe.node.get_publishers_info_by_topic("/imu/data"), "still there")
    probe.node.destroy_publisher(publisher)


def test_life_of_a_managed_corrector(tmp_path):
    model = write_model(tmp_path / "soft.yaml")
    raw = samples(1, seconds=9.0)
    with ros_domain() as environment, Probe(environment) as probe, NodeProcess(
            "managed_corrector", environment, {}, *parameters_file(
                tmp_path, model_file=str(tmp_path / "missing.yaml"), sample_rate_hz=RATE_HZ,
                qos_overrides=reliable("/imu/data_raw"))) as node:
        assert state(probe) == "unconfigured"
        assert not probe.node.get_publishers_info_by_topic("/imu/data")
        # what cannot be, is refused, and the node goes on
        assert not change(probe, "activate") and not change(probe, "configure")
        node.wait_for("cannot be configured: ")
        assert "missing.yaml" in node.text and "Traceback" not in node.text
        assert state(probe) == "unconfigured"
        assert probe.set_parameter("corrector", "model_file", str(model)).successful
        received, states = probe.collect(Imu, "/imu/data"), []
        probe.node.create_subscription(
            TransitionEvent, "/corrector/transition_event",
            lambda event: states.append((event.start_state.label, event.goal_state.label)), 10)
        for _ in range(2):  # a second life is as the first
            live(probe, node, model, raw, received)
        # what launch/managed.launch.py waits for
        assert states.count(("configuring", "inactive")) == 2
        assert change(probe, "shutdown")
        assert node.wait() == 0


def last(reference):
    """Stamp of the last sample, as a message has it."""
    seconds, nanoseconds = divmod(int(reference.stamps_ns[-1]), 10**9)
    return Time(sec=seconds, nanosec=nanoseconds)


def test_a_corrector_beside_a_node_of_others_in_one_process(tmp_path):
    """As in a container: one executor, one process, no runner of ours."""
    model, raw = write_model(tmp_path / "soft.yaml"), samples(2)
    messages = cdr.encode_samples(cdr.IMU, raw)
    with ros_domain() as environment, Probe(environment) as probe:
        heard = []
        corrector = Corrector("seat_corrector", context=probe._context, namespace="seat",
                              parameter_overrides=[
                                  Parameter("model_file", value=str(model)),
                                  Parameter("sample_rate_hz", value=RATE_HZ)])
        other = Node("logger", context=probe._context)
        other.create_subscription(Imu, "/seat/imu/data", heard.append, 10_000)
        executor = SingleThreadedExecutor(context=probe._context)
        executor.add_node(other)
        corrector.join(executor)
        try:
            publisher = other.create_publisher(Imu, "/seat/imu/data_raw", 10_000)
            probe.until(lambda: executor.spin_once(timeout_sec=0.01)
                        or publisher.get_subscription_count()
                        and other.count_publishers("/seat/imu/data"), "no match")
            for _ in range(50):
                executor.spin_once(timeout_sec=0.02)
            reference = expected(model, raw)
            with background(publish, [(publisher, messages)], RATE_HZ):
                # what is sent right after a match may get lost
                probe.until(lambda: executor.spin_once(timeout_sec=0.01)
                            or len(heard) > 0.9 * len(reference)
                            and heard[-1].header.stamp == last(reference),
                            lambda: f"{len(heard)} heard", 60.0)
        finally:
            corrector.finish()
            executor.shutdown()
            for node in (corrector, other):
                node.destroy_node()
        corrected = cdr.read_samples(cdr.IMU, [serialize_message(message) for message in heard])
        place = np.searchsorted(reference.stamps_ns, corrected.stamps_ns)
        np.testing.assert_array_equal(corrected.values, reference.values[place])
