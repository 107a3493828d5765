"""Messages that wait until the filter gives out their samples."""

import itertools

from ..io.motion import MovedMotion


class WaitingMessages:
    """Those of one topic, in the order in which they came, each with its time.

    Orientation and angular velocity of a message that comes out are taken to its new instant with
    the help of those that never do: while a filter warms up, there are messages before the first
    corrected one.

    Parameters
    ----------
    type_name : str
        Their type.
    """

    def __init__(self, type_name):
        self._motion = MovedMotion(type_name)
        self._count = 0
        self._waiting = {}

    def __len__(self):
        return len(self._waiting)

    def add(self, messages, times_ns):
        """The next ones, each with its time."""
        self._waiting.update(enumerate(zip(messages, times_ns), self._count))
        self._count += len(messages)

    def given(self, index, delay_ns):
        """Messages and times of the samples that a filter gives out.

        Parameters
        ----------
        index : list of int
            Their numbers, rising. A message that is passed over never comes out.
        delay_ns : int
            How far before its stamp a sample's new instant lies.
        """
        if not index:
            return [], []
        passed = self._passed(index[-1] + 1, delay_ns)
        return tuple(zip(*[passed[number] for number in index]))

    def keep(self, index, delay_ns):
        """Forget all but those with these rising numbers, which can still come out."""
        self._passed(index[0] if index else self._count, delay_ns)
        self._waiting = {number: self._waiting[number] for number in index}

    def _passed(self, stop, delay_ns):
        numbers = list(itertools.takewhile(lambda number: number < stop, self._waiting))
        passed = [self._waiting.pop(number) for number in numbers]
        messages = self._motion.moved([message for message, _ in passed], delay_ns)
        return dict(zip(numbers, zip(messages, [time_ns for _, time_ns in passed])))
