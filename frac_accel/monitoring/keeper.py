"""From a watched sensor to what is said and done: diagnosis, trial, another model, and back."""

import time
from pathlib import Path

from ..errors import FracAccelError
from ..io.regular_file import sha256_of
from ..model import SensorModel
from .errand import Errand
from .journal import Journal
from .mutual import NOBODY, REFERENCE, SENSOR, UNKNOWN, Mutual
from .trial import Trial
from .watch import ENOUGH_S, Watch

APPLY = ("never", "confirmed")
"""Whether an extended model goes to the corrector by itself, once it has won on later data."""

# Verdicts whose extended model may be worth having.
_WORTH_TRYING = ("explained", "partly_explained")


class Keeper:
    """Keeps the model of one axis of a sensor right, one step after the other.

    Parameters
    ----------
    model_file : str
        The model in use.
    folder : str
        For results; see `Journal`.
    axis : {"x", "y", "z"}
    apply : str
        One of `APPLY`.
    limit_mb, budget, time_limit_s, niceness, every_s, false_alarm_h : float
        Of the folder, of the processor (share of a core), of a diagnosis and its process, of
        diagnoses without an alarm (0: none), and between false alarms.
    give : callable
        Called with a model file that the corrector is to use; returns once that has been asked
        for. The answer comes by `given`.
    mutual : bool
        Whether the reference may have changed as well as the sensor: nothing is diagnosed then
        until a third sensor has shown that it is the sensor.

    Attributes
    ----------
    model_file : str
    latest : dict
        Result of the last diagnosis; empty before one.
    trial : Trial or None
    blamed : str
        Who has changed, by `Mutual.changed`.
    state : str
        learning, watching, changed (waiting for motion), diagnosing or trying.
    """

    def __init__(self, model_file, folder, axis, apply, give, *, limit_mb=500.0, budget=0.05,
                 time_limit_s=60.0, niceness=19, every_s=0.0, false_alarm_h=1000.0, mutual=False):
        if apply not in APPLY:
            raise FracAccelError(f"apply: {apply!r} given, expected {' or '.join(APPLY)}")
        self._axis, self._apply, self._give = axis, apply, give
        self._budget, self._every_s = budget, every_s
        self._limits = time_limit_s, niceness
        self.journal = Journal(folder, limit_mb)
        self.model_file = str(Path(model_file).resolve())
        self.watch = Watch(SensorModel.load(model_file), axis, false_alarm_h)
        self._mutual = Mutual(self.watch.model, axis, false_alarm_h) if mutual else None
        self.blamed = NOBODY
        self.latest, self.trial, self.notes = {}, None, []
        self._errand = self._candidate = self._asked = None
        self._reason, self._last_s = "", time.monotonic()
        self._is_told = self._is_examined = False
        self._note("started", model=self.model_file, sha256=sha256_of(self.model_file), apply=apply)

    @property
    def state(self):
        """What it is at."""
        if self._errand is not None:
            return "diagnosing"
        if self.trial is not None and self.trial.verdict == "open":
            return "trying"
        if self.watch.changed is not None and not self._is_examined:
            return "changed"
        return "learning" if self.watch.learning else "watching"

    def add(self, reference, sensor, third=None):
        """Take in samples of the topics, any of which may be None."""
        for window in self.watch.add(reference, sensor):
            if self.trial is not None and self.trial.verdict == "open":
                self._compare(window)
        if self.watch.changed is not None and not self._is_told:
            self._is_told = True
            change = self.watch.changed
            self._note("changed", onset_ns=change.ns, interval_ns=[change.low_ns, change.high_ns],
                       gradual=change.is_gradual)
        self._blame(reference, sensor, third)

    def _blame(self, *samples):
        """Say who has changed, each time that it is somebody else."""
        blamed = SENSOR if self.watch.changed is not None else NOBODY
        if self._mutual is not None:
            self._mutual.add(*samples)
            blamed = self._mutual.changed(self.watch.changed is not None)
        if self._mutual is not None and blamed != self.blamed:
            self._note("blamed", who=blamed)
        self.blamed = blamed

    def turn(self):
        """Go on with what is going on; several times a second."""
        if self._errand is not None:
            result = self._errand.turn()
            if result is not None:
                self._finish(result)
            return
        waits = self.trial is not None and self.trial.verdict == "open"
        if self.blamed == SENSOR and not self._is_examined and not waits \
                and self.watch.excited_since_s() >= ENOUGH_S:
            self._is_examined = True
            self.diagnose("a change")
        elif self._every_s and time.monotonic() - self._last_s >= self._every_s and not waits:
            self.diagnose("time")

    def diagnose(self, reason):
        """Begin a diagnosis; why none is begun, or an empty text."""
        if self._errand is not None:
            return "a diagnosis is under way"
        if self.blamed in (REFERENCE, UNKNOWN):
            return f"the sensor may be as it was: of three, {self.blamed} has changed"
        pair = self.watch.to_diagnose()
        if pair is None:
            return "there is no well excited stretch yet"
        self._last_s, self._reason = time.monotonic(), reason
        folder = self.journal.begin()
        try:
            self._errand = Errand(folder, pair, self.model_file, self._axis, self._budget,
                                  *self._limits)
        except (OSError, FracAccelError) as error:
            return f"no diagnosis: {error}"
        self._note("diagnosing", reason=reason, stretch_ns=[int(pair[1].stamps_ns[0]),
                                                            int(pair[1].stamps_ns[-1])])
        return ""

    def apply_now(self):
        """Give the corrector the extended model; why not, or an empty text."""
        if self._candidate is None:
            return "no extended model is at hand"
        return self._ask("applied", self._candidate)

    def roll_back(self):
        """Give the corrector the model that it had before; why not, or an empty text."""
        models = self.journal.models()
        return self._ask("rolled back", models[-1][0]) if models else \
            "no model has been applied that could be taken back"

    def given(self, reason):
        """The corrector's answer: empty where it uses the model now."""
        if self._asked is None:
            return
        (step, model_file), self._asked = self._asked, None
        if reason:
            self._note("refused", model=model_file, reason=reason)
            return
        self._note(step, model=model_file, before=self.model_file, sha256=sha256_of(model_file),
                   gain=self.trial.gain if self.trial else None)
        self.model_file, self._candidate, self.trial = model_file, None, None
        self.latest, self._is_told, self._is_examined = {}, False, False
        self.watch.use(SensorModel.load(model_file))
        if self._mutual is not None:
            self._mutual.use(self.watch.model)

    def end(self):
        """Leave nothing running."""
        if self._errand is not None:
            self._errand.end()

    def _ask(self, step, model_file):
        if self._asked is not None:
            return "the corrector has not answered yet"
        self._asked = step, model_file
        self._give(model_file)
        return ""

    def _finish(self, result):
        cpu_s, folder = self._errand.cpu_s, self._errand.folder
        self._errand = None
        result["onset"] = self.watch.changed and self.watch.changed._asdict()
        result["trigger"], result["cpu_s"] = self._reason, cpu_s
        place = self.journal.complete(folder)
        self.latest = {**result, "folder": str(place)}
        causes = [finding["cause"] for finding in result["findings"]]
        self._note("diagnosed", verdict=result["verdict"], causes=causes, folder=place.name,
                   reason=result.get("reason"), cpu_s=cpu_s)
        extended = place / "model.yaml"
        if causes and result["verdict"] in _WORTH_TRYING and extended.exists():
            self._candidate, self.trial = str(extended), Trial()
            self._model = SensorModel.load(extended)

    def _compare(self, window):
        try:
            self.trial.add(window.rms, self.watch.residual_rms(self._model, window))
        except FracAccelError:
            return
        if self.trial.verdict == "open":
            return
        self._note(f"trial {self.trial.verdict}", model=self._candidate,
                   windows=self.trial.windows, gain=self.trial.gain)
        if self.trial.verdict == "won" and self._apply == "confirmed":
            self.apply_now()

    def _note(self, step, **what):
        self.notes.append(self.journal.note(step, **what))
