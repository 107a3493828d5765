"""How far a diagnosis is: nobody knows how many causes there are, so each stage takes a share."""

# Share of the whole at which the stages end, as measured of the bags that come with the package.
CHECKED, IDENTIFIED, SEARCHED, COMPARED, JUDGED = 0.02, 0.05, 0.8, 0.9, 1.0


class Stages:
    """Tells a callback what is being done, and the share that is done; it never goes back.

    Parameters
    ----------
    progress : callable or None
        Called with words and a share from 0 to 1.
    limit : TimeLimit
        What of it is spent is done, whatever the stage.
    """

    def __init__(self, progress, limit):
        self._progress, self.limit = progress, limit
        self._words, self._start, self._end, self._share = "", 0.0, 0.0, 0.0

    def enter(self, words, end):
        """Begin a stage that ends at a share."""
        self._words, self._start, self._end = words, self._share, max(end, self._share)
        self.within(0.0)

    def enter_round(self, words, end):
        """Begin one of an unknown number of stages before a share: half of what is left."""
        self.enter(words, self._share + 0.5 * max(end - self._share, 0.0))

    def within(self, part):
        """This part of the stage is done."""
        if self._progress is None:
            return
        share = self._start + part * (self._end - self._start)
        spent = min(self.limit.spent_s() / self.limit.seconds, 1.0)
        self._share = max(self._share, share, spent)
        self._progress(self._words, self._share)
