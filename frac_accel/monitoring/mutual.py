"""Which of two sensors on one body has changed: each is the other's reference, a third decides.

Two sensors that watch each other show that one of them has changed, and never which. A third one is
compared with both; whichever sensor is in every pair that has changed, and in no other, is it.
"""

from ..model import SensorModel
from .detector import FALSE_ALARM_H
from .watch import Watch

SENSOR, REFERENCE, THIRD = "sensor", "reference", "third"
NOBODY, UNKNOWN = "", "one of them"
# Pairs beside sensor and reference, and who has changed by which of all three have.
_BY_PAIRS = {(True, True, False): SENSOR, (True, False, True): REFERENCE,
             (False, True, True): THIRD, (False, False, False): NOBODY}


class Mutual:
    """Watches two sensors against a third, beside a `Watch` of the one against the other.

    Parameters
    ----------
    model : SensorModel
        Of the sensor; reference and third are taken to show what moves them.
    axis : {"x", "y", "z"}
    false_alarm_h : float
        Mean time between false alarms of each pair [h].
    """

    def __init__(self, model, axis="x", false_alarm_h=FALSE_ALARM_H):
        flat = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1",
                                      "core": {"type": "gain", "sensitivity": 1.0}})
        self._sensor = Watch(model, axis, false_alarm_h)
        self._reference = Watch(flat, axis, false_alarm_h)

    def add(self, reference, sensor, third):
        """Take in samples, any of which may be None."""
        self._sensor.add(third, sensor)
        self._reference.add(third, reference)

    def use(self, model):
        """Go on with another model of the sensor, as `Watch.use`."""
        self._sensor.use(model)
        self._reference.use(self._reference.model)

    def changed(self, has_changed):
        """Who has changed: one of the names above, by whether sensor and reference disagree."""
        pairs = has_changed, *(watch.changed is not None
                               for watch in (self._sensor, self._reference))
        return _BY_PAIRS.get(pairs, UNKNOWN)
