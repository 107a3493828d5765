"""The parameters that each sensor of the corrector has."""

from frac_accel.io import cdr
from frac_accel.nodes._errors import NodeError, did_you_mean
from frac_accel.nodes._filtered_topic import ON_TWO_PUBLISHERS
from frac_accel.streaming.stream import ON_FAULT

DESIGN_PARAMETERS = ("model_file", "bandwidth_hz", "lowest_hz", "max_delay_s")
"""What the filter is designed by, which may change while it runs."""

_LARGEST = {"minimum": 0.0, "maximum": 1e15}
_HZ = {"minimum": 0.0, "maximum": 1e8}
_S = {"minimum": 0.0, "maximum": 3600.0}
SENSOR_PARAMETERS = {
    "model_file": ("", "sensor model (YAML) to correct with", {}),
    "plausible_range": (
        [0.0, 0.0], "lowest and highest raw value that can be true; both 0: the model's range, or "
                    "what the record itself says", {}),
    "on_fault": (
        "covariance", "output while an axis is dead, stuck, saturated or held: covariance (that "
                      "nothing trusts it), drop (none) or report (as ever)", {}),
    "on_two_publishers": (
        "first", "raw topic with two publishers: first (the other is dropped) or none", {}),
    "largest_rate": (
        0.0, "largest rate of change of the raw signal that is no fault [1/s]; 0: any", _LARGEST),
    "stale_after_s": (
        0.5, "time without a corrected sample after which the output counts as stale",
        {"minimum": 0.01, "maximum": 3600.0}),
    "sample_rate_hz": (
        0.0, "sampling rate of the sensor; 0: estimated from the first hundred stamps", _HZ),
    "bandwidth_hz": (
        0.0, "highest frequency to correct; 0: where the sensor's gain has fallen to a fifth, at "
             "most 0.6 of the Nyquist frequency", _HZ),
    "lowest_hz": (
        0.0, "lowest frequency to correct; 0: none, or where a high-pass leaves a fifth", _HZ),
    "max_delay_s": (
        0.0, "permitted delay of the filter; 0: the shortest with noise within 30 % of an ideal "
             "band limit", _S),
    "noise_std": (
        0.0, "standard deviation of the raw noise where messages come without a covariance; 0: "
             "the model's", {"minimum": 0.0, "maximum": 1e12}),
    "message_type": (cdr.IMU, "type of raw, corrected and reference: ", {}),
    "frame_id": ("", "frame of the corrected messages; empty: that of the raw ones", {}),
}
"""Name: default, description and range."""

TOPICS = {
    "namespace": "where the sensor's topics are; empty: below its name",
    "raw_topic": "empty: imu/data_raw, or accel/blocks_raw, in the sensor's namespace",
    "corrected_topic": "empty: imu/data, or accel/blocks, in the sensor's namespace",
    "reference_topic": "what the true acceleration is published on, if anything",
    "temperature_topic": "sensor_msgs/Temperature; empty: imu/temperature in the sensor's "
                         "namespace, where the model needs it",
}
"""Further parameters of a sensor that is one of many; a single one has its topics remapped."""


def declare_sensor(node, name="", given=None):
    """Declare the parameters of a sensor, below its name if it has one.

    Parameters
    ----------
    node : FracAccelNode
    name : str
    given : dict, optional
        Values instead of the node's own parameters of the same names, which are the defaults.

    Raises
    ------
    NodeError
        If a value is not possible.
    """
    given = given or {}
    known = SENSOR_PARAMETERS if not name else {**SENSOR_PARAMETERS, **dict.fromkeys(TOPICS)}
    if unknown := sorted(given.keys() - known.keys()):
        hint = did_you_mean(unknown[0], known) or f": {', '.join(known)}"
        raise NodeError(f"'{unknown[0]}' is no parameter of a sensor{hint}")
    types = cdr.ACCELERATION_TYPES if name else cdr.SAMPLE_TYPES
    prefix = f"{name}." if name else ""
    for key, (default, description, limits) in SENSOR_PARAMETERS.items():
        if key == "message_type":
            description += " or ".join(types)
        if name:
            default = node.get_parameter(key).value
        # those of one of many go with it, which read-only ones could not
        node.declare(prefix + key, given.get(key, default), description,
                     read_only=not name and key not in DESIGN_PARAMETERS, like=default, **limits)
    if name:
        for key, description in TOPICS.items():
            node.declare(prefix + key, given.get(key, ""), description, read_only=False, like="")
    for key, words in (("on_fault", ON_FAULT), ("on_two_publishers", ON_TWO_PUBLISHERS),
                       ("message_type", types)):
        value = node.get_parameter(prefix + key).value
        if value not in words:
            raise NodeError(
                f"parameter '{prefix}{key}' must be {' or '.join(words)}, got {value!r}")
    stated = node.get_parameter(f"{prefix}plausible_range").value
    if len(stated) != 2:
        raise NodeError(f"parameter '{prefix}plausible_range' must be two numbers, got "
                        f"{list(stated)}")


def forget_sensor(node, name):
    """Take back what `declare_sensor` has declared."""
    for key in (*SENSOR_PARAMETERS, *TOPICS):
        if node.has_parameter(f"{name}.{key}"):
            node.undeclare_parameter(f"{name}.{key}")
