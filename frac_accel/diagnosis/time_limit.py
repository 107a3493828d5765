"""Budget of processor time: a search that has used it up says what it left out."""

import contextlib
import copy
import time

from ..simulation.compiling import compiled_s

# Share of the budget after which nothing new is tried, so that what is known can be judged; and in
# a part of a long record, the whole of which has to be fitted, too.
_SEARCH, _SEARCH_IN_PART = 0.6, 0.4
# The same after which a set that leaves little grows no more: its names matter more than the rest.
_GROWING = 0.2
# The same for the rivals of what was found, without which nothing has a name.
_RIVALS, _RIVALS_IN_PART = 0.85, 0.65


class TimeLimit:
    """Counts the processor time of this process from its making, but for what compiling takes.

    Parameters
    ----------
    seconds : float
        Budget; infinite for none.

    Attributes
    ----------
    left_out : list of str
        What was not done because of it, each once.
    """

    def __init__(self, seconds=float("inf")):
        self.seconds = seconds
        self._start = time.process_time() - compiled_s()
        self.left_out = []
        self._search, self._rivals = _SEARCH, _RIVALS

    def of_part(self):
        """The same budget for the search in a part of a long record."""
        limit = copy.copy(self)
        limit._search, limit._rivals = _SEARCH_IN_PART, _RIVALS_IN_PART
        return limit

    def spent_s(self):
        """Processor time [s] since the start."""
        return time.process_time() - compiled_s() - self._start

    def ends_growing(self, words=None):
        """Whether a set that leaves little must not grow any more; notes what is left out."""
        return self._over(_GROWING, words)

    def ends_search(self, words=None):
        """Whether the search must end; notes what is left out because of it."""
        return self._over(self._search, words)

    @contextlib.contextmanager
    def for_rivals(self):
        """While the rivals of what was found are tried, the search may take their share, too."""
        search, self._search = self._search, self._rivals
        try:
            yield
        finally:
            self._search = search

    def ends_judging(self, words=None):
        """Whether nothing that can be spared is done any more."""
        return self._over(1.0, words)

    def _over(self, share, words):
        over = self.spent_s() > share * self.seconds
        if over and words and words not in self.left_out:
            self.left_out.append(words)
        return over

    def summary(self):
        """What was left out, as a sentence; None where nothing was."""
        if not self.left_out:
            return None
        return (f"the search was cut at its limit of {self.seconds:g} s of processor time: "
                f"{'; '.join(self.left_out)}")
