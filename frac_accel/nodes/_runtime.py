"""What all nodes share: start and end of the process, parameters, serialised subscriptions."""

from __future__ import annotations

import contextlib
import importlib
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.exceptions import (
    InvalidNodeNameException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    InvalidTopicNameException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_policy_name_from_kind
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions

from frac_accel.errors import FracAccelError

# The longest that a signal or the end of a node's work goes unnoticed.
_POLL_S = 0.1
# How often timers, services and all that is not taken directly have their turn beside it.
_EXECUTOR_PERIOD_S = 0.05

INVALID_ENDPOINT = (
    InvalidTopicNameException,
    InvalidQosOverridesError,
    InvalidParameterTypeException,
    RuntimeError,  # an unknown word as override of a QoS policy
    ValueError,
)
"""What rclpy raises for a publisher or subscription that the user has named or set up wrongly."""


class NodeError(FracAccelError):
    """A node that cannot start or go on as asked for."""


class FracAccelNode(Node):
    """A node that `run_node` can end.

    A subclass sets ``done`` when its work is over, and cleans up in `finish`, which is called
    once, before the context is shut down, whether the node is done or a signal has come.
    """

    done = False

    def __init__(self, name: str) -> None:
        self.direct_subscriptions: list[RawSubscription] = []
        super().__init__(name)

    def finish(self) -> None:
        """Complete what the node was doing; nothing by default."""

    def declare(
        self,
        name: str,
        default,
        description: str,
        *,
        read_only: bool = True,
        minimum: float | None = None,
        maximum: float | None = None,
    ):
        """Declare a parameter with its descriptor and return its value.

        Raises
        ------
        NodeError
            If the value given by the user has another type or is out of range.
        """
        descriptor = ParameterDescriptor(description=description, read_only=read_only)
        if minimum is not None or maximum is not None:
            is_float = isinstance(default, float)
            limit = float if is_float else int
            low = limit(minimum if minimum is not None else -(2**53))
            high = limit(maximum if maximum is not None else 2**53)
            if is_float:
                limits = FloatingPointRange(from_value=low, to_value=high)
                descriptor.floating_point_range = [limits]
            else:
                descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
        try:
            return self.declare_parameter(name, default, descriptor).value
        except InvalidParameterTypeException as error:
            text = str(error).removesuffix(f": {name}")
            raise NodeError(f"{text}, such as {default!r}") from None
        except InvalidParameterValueException as error:
            given = str(error).removesuffix(f": {name}").rpartition("value: ")[2]
            raise NodeError(
                f"parameter '{name}' must lie in [{minimum}, {maximum}], got {given}"
            ) from None


def run_node(make_node: Callable[[], FracAccelNode], arguments: Sequence[str] | None = None) -> int:
    """Run a node until it is done or the process gets SIGINT or SIGTERM; returns the exit status.

    0, or 2 after one line on stderr that says what is wrong.  The first signal ends the node in
    order (`FracAccelNode.finish`), a second one at once.
    """
    program = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", make_node.__name__).lower()
    node = executor = None
    stop = _StopSignals()
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        node = make_node()
        executor = make_executor()
        executor.add_node(node)
        direct = _DirectIntake(node)
        while not (stop.requested or node.done):
            # A bounded wait, because a Python signal handler runs only between two of them.
            if direct.is_possible:
                direct.wait(_EXECUTOR_PERIOD_S)
                executor.spin_once(timeout_sec=0)
            else:
                executor.spin_once(timeout_sec=_POLL_S)
        node.finish()
        return 0
    except FracAccelError as error:
        return _fail(program, error)
    except (
        rclpy_implementation.RCLError,
        rclpy_implementation.UnknownROSArgsError,
        InvalidNodeNameException,
    ) as error:
        return _fail(program, error)
    except (KeyboardInterrupt, ExternalShutdownException):
        return 0
    finally:
        if executor is not None:
            executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def make_executor():
    """The executor that all nodes spin on.

    Callbacks drain their queue (`RawSubscription`), so that the default executor's cost per
    wake-up is shared by all messages that have come in the meantime.
    """
    return SingleThreadedExecutor()


def import_message_class(type_name: str) -> type:
    """Python class of a type such as ``sensor_msgs/msg/Imu``; `NodeError` if it is not there."""
    parts = type_name.split("/")
    if len(parts) != 3 or not all(part.isidentifier() for part in parts):
        raise NodeError(f"'{type_name}' is not the name of a message type")
    try:
        message_class = getattr(importlib.import_module(f"{parts[0]}.{parts[1]}"), parts[2])
    except (ImportError, AttributeError):
        raise NodeError(f"message type {type_name} is not installed here") from None
    return message_class


def normalised(data: bytes, message_class: type) -> bytes:
    """The same message as plain little-endian CDR, by way of the typed message.

    For the rare message that the code for serialised ones does not know how to take apart.

    Raises
    ------
    NodeError
        If the middleware cannot read it either.
    """
    try:
        return serialize_message(deserialize_message(data, message_class))
    except Exception as error:  # rclpy raises RuntimeError, MemoryError or its own classes
        name = message_class.__name__
        raise NodeError(f"a {name} of {len(data)} bytes cannot be read: {error}") from None


class RawMessage(NamedTuple):
    """A serialised message, its times (sent by the publisher, taken in here) and its number.

    Every publisher counts its own messages; None where the middleware does not tell.
    """

    data: bytes
    source_time_ns: int
    received_time_ns: int
    sequence: int | None = None


class RawSubscription:
    """Subscription that hands over all serialised messages that are waiting, in one call.

    One callback of rclpy's executors costs as much as taking ten messages.  Each callback here
    takes all that are there, through ``subscription.handle.take_message``, which rclpy does not
    document; where that fails, messages are handed over one by one.

    Parameters
    ----------
    node, message_class, topic, qos, callback_group : as for ``Node.create_subscription``
        The QoS can be overridden by the ROS parameters
        ``qos_overrides.TOPIC.subscription.{reliability,history,depth}``.
    callback : called with a non-empty list of `RawMessage`
    is_direct : bool
        Wait for this topic outside rclpy's executor, whose every wake-up costs as much as
        filtering fifty samples. Only for a `FracAccelNode` in `run_node`.

    Attributes
    ----------
    lost : int
        Messages that were sent since the first one received and have not come: gaps in the
        publisher's sequence numbers if the middleware gives them and the topic has one
        publisher, else what the middleware reports.

    Raises
    ------
    NodeError
        If the topic's name or an overriding parameter is not valid.
    """

    # A callback that went on for ever would starve the timers.
    _MAX_BATCH = 1000

    def __init__(
        self,
        node: Node,
        message_class: type,
        topic: str,
        callback: Callable[[list[RawMessage]], None],
        qos: QoSProfile,
        callback_group: CallbackGroup | None = None,
        is_direct: bool = False,
    ) -> None:
        self.lost = 0
        if is_direct:
            callback_group = OutsideExecutor()
            node.direct_subscriptions.append(self)
        self.callback_group = callback_group
        self._last_sequence: int | None = None
        self._callback = callback
        self._message_class = message_class
        self._logger = node.get_logger()
        self._can_drain = True

        def create(events: SubscriptionEventCallbacks):
            return node.create_subscription(
                message_class,
                topic,
                self._on_message,
                qos,
                raw=True,
                callback_group=callback_group,
                event_callbacks=events,
                qos_overriding_options=QoSOverridingOptions.with_default_policies(),
            )

        try:
            self.subscription = create(
                SubscriptionEventCallbacks(
                    message_lost=self._on_lost, incompatible_qos=self._on_incompatible_qos
                )
            )
        except UnsupportedEventTypeError:
            self.subscription = create(SubscriptionEventCallbacks())
        except INVALID_ENDPOINT as error:
            raise NodeError(f"topic {topic} cannot be subscribed to: {error}") from None

    def drain(self) -> None:
        """Hand over what is waiting, until nothing is; a node calls it before it ends."""
        while self.take_batch():
            pass

    def take_batch(self) -> bool:
        """Hand over what is waiting now, once; whether there was anything."""
        batch = self._waiting()
        if batch:
            self._callback(batch)
        return bool(batch)

    def _on_message(self, data: bytes, info) -> None:
        self._callback([self._received(data, info), *self._waiting()])

    def _received(self, data: bytes, info) -> RawMessage:
        sequence, last = info["publication_sequence_number"], self._last_sequence
        if sequence is not None:
            if (last is not None and sequence > last + 1
                    and self.subscription.get_publisher_count() <= 1):
                self.lost += sequence - last - 1
            self._last_sequence = sequence
        received = info["received_timestamp"] or time.time_ns()
        return RawMessage(data, info["source_timestamp"] or received, received, sequence)

    def _waiting(self) -> list[RawMessage]:
        batch: list[RawMessage] = []
        if not self._can_drain:
            return batch
        handle = self.subscription.handle
        try:
            with handle:
                take, message_class, received = (
                    handle.take_message, self._message_class, self._received)
                for _ in range(self._MAX_BATCH):
                    taken = take(message_class, True)
                    if taken is None:
                        break
                    batch.append(received(*taken))
        except (AttributeError, TypeError, rclpy_implementation.RCLError) as error:
            self._can_drain = False
            self._logger.warning(f"taking messages one by one: {error}")
        return batch

    def _on_lost(self, event) -> None:
        if self._last_sequence is None:
            self.lost += event.total_count_change

    def _on_incompatible_qos(self, event) -> None:
        policy = qos_policy_name_from_kind(event.last_policy_kind)
        self._logger.warning(
            f"{self.subscription.topic_name}: a publisher offers an incompatible {policy}; "
            "nothing is received from it"
        )


def publish_serialized(publisher, messages: Sequence[bytes]) -> None:
    """Publish serialised messages.

    Through ``publisher.handle``, which rclpy does not document, at a third of the cost that
    ``publish`` adds to each; where that fails, through ``publish``.
    """
    handle = getattr(publisher, "handle", None)
    publish = getattr(handle, "publish_raw", None)
    with handle if publish else contextlib.nullcontext():
        for message in messages:
            (publish or publisher.publish)(message)


class OutsideExecutor(CallbackGroup):
    """Keeps a subscription out of the executor, for as long as `is_active`."""

    is_active = True

    def can_execute(self, entity):
        return not self.is_active

    def beginning_execution(self, entity):
        return not self.is_active

    def ending_execution(self, entity):
        pass


class _DirectIntake:
    """Waits for the direct subscriptions of a node with a wait set of its own.

    It is what rclpy's executors use themselves, and not documented; where it fails, the executor
    takes the subscriptions over.

    Attributes
    ----------
    is_possible : bool
    """

    def __init__(self, node: FracAccelNode) -> None:
        self._subscriptions = node.direct_subscriptions
        self._logger = node.get_logger()
        self._wait_set = None
        self.is_possible = bool(self._subscriptions)
        if self.is_possible:
            self._attempt(self._make, node)

    def wait(self, seconds: float) -> None:
        """Hand over what comes within this time."""
        end_s = time.monotonic() + seconds
        while (left_s := end_s - time.monotonic()) > 0 and self.is_possible:
            for subscription in self._attempt(self._ready, left_s) or ():
                subscription.take_batch()

    def _make(self, node: FracAccelNode) -> None:
        self._wait_set = rclpy_implementation.WaitSet(
            len(self._subscriptions), 0, 0, 0, 0, 0, node.context.handle)

    def _ready(self, seconds: float) -> list[RawSubscription]:
        self._wait_set.clear_entities()
        handles = [each.subscription.handle for each in self._subscriptions]
        for handle in handles:
            self._wait_set.add_subscription(handle)
        self._wait_set.wait(int(seconds * 1e9))
        ready = self._wait_set.get_ready_entities("subscription")
        return [each for each, handle in zip(self._subscriptions, handles)
                if handle.pointer in ready]

    def _attempt(self, function, *arguments):
        try:
            return function(*arguments)
        except (AttributeError, TypeError, rclpy_implementation.RCLError) as error:
            self.is_possible = False
            for subscription in self._subscriptions:
                subscription.callback_group.is_active = False
            self._logger.warning(f"messages are waited for by the executor: {error}")
            return None


class _StopSignals:
    """Remembers the first SIGINT or SIGTERM; the next one has its default effect."""

    def __init__(self) -> None:
        self.requested = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, *_) -> None:
        self.requested = True
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_DFL)


def _fail(program: str, error: Exception) -> int:
    line = " ".join(str(error).split())
    print(f"{program}: error: {line}", file=sys.stderr, flush=True)
    return 2
