"""What all nodes share: start and end of the process, parameters, types of messages."""

from __future__ import annotations

import importlib
import re
import signal
import sys
import time
from collections.abc import Callable, Sequence

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import (
    InvalidNodeNameException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from frac_accel.errors import FracAccelError
from frac_accel.nodes._errors import NodeError, did_you_mean
from frac_accel.nodes._intake import DirectIntake, RawSubscription
from frac_accel.nodes._service import ServiceManager

# How often the executor has a turn for what `DirectIntake` does not look at, such as events of QoS.
_EXECUTOR_PERIOD_S = 1.0
_POLL_S = 0.001


class FracAccelNode(Node):
    """A node that `run_node` can end.

    A subclass sets ``done`` when its work is over, and cleans up in `finish`, which is called
    once, before the context is shut down, whether the node is done or a signal has come.
    Outputs are withheld where it is not ``is_active``. ``latency_budget_s`` is how long messages
    may wait for others to be handled with, ``turns`` what is called every ``turn_s`` between them:
    the longest, too, that a signal goes unnoticed.
    """

    done = False
    is_active = True
    latency_budget_s = 0.0
    turn_s = 0.2

    def __init__(self, name: str, **options) -> None:
        self.direct_subscriptions: list[RawSubscription] = []
        self.turns: list[Callable[[], None]] = []
        super().__init__(name, **options)

    def warn_of_unknown_parameters(self) -> None:
        """Name what the user has set and the node does not know, once all is declared.

        What has been set is not documented in rclpy; where it cannot be had, nothing is said.
        """
        declared = [name for name in self.list_parameters([], 0).names
                    if not name.startswith("qos_overrides.")]
        for name in getattr(self, "_parameter_overrides", ()):
            if self.has_parameter(name) or name.startswith("qos_overrides."):
                continue
            self.get_logger().warning(
                f"parameter '{name}' is not known here{did_you_mean(name, declared)}")

    def take_turn(self) -> None:
        """Do what has its turn now."""
        for turn in list(self.turns):
            turn()

    def take_in(self) -> None:
        """Take what has come, and wait a little: for whoever waits in the executor's thread."""
        for subscription in list(self.direct_subscriptions):
            subscription.drain()
        time.sleep(_POLL_S)

    def join(self, executor) -> None:
        """Let the executor of another program run this node, beside nodes of any kind.

        A timer takes what has come, as often as the latency budget says; `run_node` is quicker.
        """
        executor.add_node(self)

        def take() -> None:
            for subscription in list(self.direct_subscriptions):
                subscription.drain()
            self.take_turn()
        # not the node's clock, which may stand still
        self.create_timer(max(self.latency_budget_s, _POLL_S), take,
                          clock=Clock(clock_type=ClockType.STEADY_TIME))

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
        like=None,
    ):
        """Declare a parameter with its descriptor and return its value.

        A default that somebody has given must be of the type of ``like``.

        Raises
        ------
        NodeError
            If the value given by the user has another type or is out of range.
        """
        if like is not None and _type(default) != _type(like):
            raise NodeError(f"parameter '{name}' must be such as {like!r}, got {default!r}")
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


def _type(value):
    return Parameter.Type.from_parameter_value(value)


def run_node(make_node: Callable[[], FracAccelNode], arguments: Sequence[str] | None = None) -> int:
    """Run a node until it is done or the process gets SIGINT or SIGTERM; returns the exit status.

    0, or 2 after one line on stderr that says what is wrong.  The first signal ends the node in
    order (`FracAccelNode.finish`), a second one at once.
    """
    program = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", make_node.__name__).lower()
    node = executor = None
    stop, service = _StopSignals(), ServiceManager()
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        _refuse_other_arguments(arguments)
        node = make_node()
        node.warn_of_unknown_parameters()
        executor = make_executor()
        executor.add_node(node)
        direct, next_s = DirectIntake(node), 0.0
        service.ready()
        while not (stop.requested or node.done):
            # A bounded wait, because a Python signal handler runs only between two of them.
            if direct.is_possible and node.direct_subscriptions:
                if direct.wait(node.turn_s) or time.monotonic() >= next_s:
                    next_s = time.monotonic() + _EXECUTOR_PERIOD_S
                    executor.spin_once(timeout_sec=0)
            else:
                executor.spin_once(timeout_sec=node.turn_s)
            node.take_turn()
            service.alive()
        service.stopping()
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


def _refuse_other_arguments(arguments):
    """A ``-p`` without ``--ros-args`` before it would be passed over without a word."""
    own = remove_ros_args(sys.argv)[1:] if arguments is None else remove_ros_args(arguments)
    if own:
        raise NodeError(f"unknown argument {own[0]}: parameters come behind --ros-args, such as "
                        "--ros-args -p model_file:=sensor.yaml; docs/nodes.md lists them")


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
