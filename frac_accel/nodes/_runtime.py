"""What all nodes share: start and end of the process, parameters, types of messages."""

from __future__ import annotations

import importlib
import re
import signal
import sys
from collections.abc import Callable, Sequence

import rclpy
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import (
    InvalidNodeNameException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
)
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions

from frac_accel.errors import FracAccelError
from frac_accel.nodes._errors import NodeError
from frac_accel.nodes._intake import DirectIntake, RawSubscription

# How often timers, services and all that is not taken directly have their turn; the longest that a
# signal or the end of a node's work goes unnoticed.
_EXECUTOR_PERIOD_S = 0.1


class FracAccelNode(Node):
    """A node that `run_node` can end.

    A subclass sets ``done`` when its work is over, and cleans up in `finish`, which is called
    once, before the context is shut down, whether the node is done or a signal has come.
    ``latency_budget_s`` is how long messages may wait for others to be handled with.
    """

    done = False
    latency_budget_s = 0.0

    def __init__(self, name: str) -> None:
        self.direct_subscriptions: list[RawSubscription] = []
        super().__init__(name)

    def take_turn(self) -> None:
        """Do what is to be done about every tenth of a second; nothing by default."""

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
        direct = DirectIntake(node)
        while not (stop.requested or node.done):
            # A bounded wait, because a Python signal handler runs only between two of them.
            if direct.is_possible and node.direct_subscriptions:
                direct.wait(_EXECUTOR_PERIOD_S)
                executor.spin_once(timeout_sec=0)
            else:
                executor.spin_once(timeout_sec=_EXECUTOR_PERIOD_S)
            node.take_turn()
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
