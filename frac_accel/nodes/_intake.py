"""Serialised messages from topics, all that wait at a time, beside rclpy's executor."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_policy_name_from_kind
from rclpy.qos_overriding_options import QoSOverridingOptions

from frac_accel.nodes._errors import INVALID_ENDPOINT, NodeError

# So few subscriptions are asked for messages without looking first whether there are any.
_FEW = 4
# Services, timers and what else is the executor's are looked at so often [s].
_LOOK_S = 0.2


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
    was_used : bool
        Whether any message has ever come.

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
        self.was_used = False
        self._node = node
        self._is_direct = is_direct
        if is_direct:
            callback_group = OutsideExecutor()
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
            # outside the executor nothing would call them
            self.subscription = create(
                SubscriptionEventCallbacks(use_default_callbacks=False) if is_direct else
                SubscriptionEventCallbacks(
                    message_lost=self._on_lost, incompatible_qos=self._on_incompatible_qos
                )
            )
        except UnsupportedEventTypeError:
            self.subscription = create(SubscriptionEventCallbacks())
        except INVALID_ENDPOINT as error:
            raise NodeError(f"topic {topic} cannot be subscribed to: {error}") from None
        if is_direct:
            node.direct_subscriptions.append(self)

    def destroy(self) -> None:
        """Receive no more."""
        if self._is_direct:
            self._node.direct_subscriptions.remove(self)
        self._node.destroy_subscription(self.subscription)

    def drain(self) -> None:
        """Hand over what is waiting, until nothing is; a node calls it before it ends."""
        while self.take_batch():
            pass

    def take_batch(self) -> bool:
        """Hand over what is waiting now, once; whether there was anything."""
        batch = self._waiting()
        if batch:
            self.was_used = True
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


def publish_serialized(publisher, messages: Sequence[bytes]) -> int:
    """Publish serialised messages; returns how many the middleware has taken.

    It takes none while the queue for a subscriber that must get all of them is full.  Through
    ``publisher.handle``, which rclpy does not document, at a third of the cost that ``publish``
    adds to each; where that fails, through ``publish``.
    """
    handle = getattr(publisher, "handle", None)
    publish = getattr(handle, "publish_raw", None)
    taken = 0
    with handle if publish else contextlib.nullcontext():
        for message in messages:
            try:
                (publish or publisher.publish)(message)
                taken += 1
            except rclpy_implementation.RCLError:
                pass
    return taken


class OutsideExecutor(CallbackGroup):
    """Keeps a subscription out of the executor, for as long as `is_active`."""

    is_active = True

    def can_execute(self, entity):
        return not self.is_active

    def beginning_execution(self, entity):
        return not self.is_active

    def ending_execution(self, entity):
        pass


class DirectIntake:
    """Waits for the direct subscriptions of a node with a wait set of its own.

    It is what rclpy's executors use themselves, and not documented; where it fails, the executor
    takes the subscriptions over. Every wake-up finds cold caches, whatever there is to do: so
    where the node has a latency budget, one wake-up serves all that comes within it.

    Parameters
    ----------
    node : FracAccelNode

    Attributes
    ----------
    is_possible : bool
    """

    def __init__(self, node) -> None:
        self._node = node
        self._messages, self._all = _WaitSet(node), _WaitSet(node)
        self._look_s, self._has_work = 0.0, False
        self.is_possible = True

    def wait(self, seconds: float) -> bool:
        """Hand over what comes within this time; ends early, and is true, if the executor has work.

        A turn of the executor costs several times what it costs to see that there is nothing for
        it.
        """
        end_s, self._has_work = time.monotonic() + seconds, False
        while ((left_s := end_s - time.monotonic()) > 0 and self.is_possible
               and not self._has_work):
            ready = self._attempt(self._ready, left_s, time.monotonic() >= self._look_s)
            if ready and self._node.latency_budget_s:
                time.sleep(self._node.latency_budget_s)
                every = self._node.direct_subscriptions
                ready = ([each for each in every if each in ready or each.was_used]
                         if len(every) <= _FEW else self._attempt(self._ready, 0.0))
            for subscription in ready or ():
                subscription.take_batch()
        return self._has_work

    def _ready(self, seconds: float, looks: bool = False) -> list[RawSubscription]:
        node, direct = self._node, self._node.direct_subscriptions
        handles = [each.subscription.handle for each in direct]
        if not looks:
            ready = self._messages.wait(seconds, handles)[0]
            return [each for each, is_ready in zip(direct, ready) if is_ready]
        others = [each.handle for each in node.subscriptions
                  if not isinstance(each.callback_group, OutsideExecutor)]
        ready, *rest = self._all.wait(
            seconds, handles + others, *([each.handle for each in kind] for kind in (
                node.timers, node.clients, node.services)))
        self._has_work = any(ready[len(handles):]) or any(map(any, rest))
        self._look_s = time.monotonic() + _LOOK_S
        return [each for each, is_ready in zip(direct, ready) if is_ready]

    def _attempt(self, function, *arguments):
        try:
            return function(*arguments)
        except (AttributeError, TypeError, rclpy_implementation.RCLError) as error:
            self.is_possible = False
            for subscription in self._node.direct_subscriptions:
                subscription.callback_group.is_active = False
            self._node.get_logger().warning(f"messages are waited for by the executor: {error}")
            return None


class _WaitSet:
    """A wait set that is made anew where it is to wait for something else."""

    _KINDS = ("subscription", "timer", "client", "service")

    def __init__(self, node) -> None:
        self._node = node
        self._set, self._handles, self._pointers = None, None, []

    def wait(self, seconds: float, *handles) -> list[list[bool]]:
        """Which of the handles of subscriptions, timers, clients and services are ready."""
        if handles != self._handles:
            counts = [*map(len, handles), 0, 0, 0][:4]
            self._set = rclpy_implementation.WaitSet(
                counts[0], 0, *counts[1:], 0, self._node.context.handle)
            self._handles = handles
            self._pointers = [[handle.pointer for handle in kind] for kind in handles]
        self._set.clear_entities()
        for kind, own in zip(self._KINDS, handles):
            add = getattr(self._set, f"add_{kind}")
            for handle in own:
                add(handle)
        self._set.wait(int(seconds * 1e9))
        return [[pointer in ready for pointer in pointers] for pointers, ready in (
            (pointers, set(self._set.get_ready_entities(kind)))
            for kind, pointers in zip(self._KINDS, self._pointers))]
