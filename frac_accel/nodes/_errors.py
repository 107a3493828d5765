"""What goes wrong where a user has named or set up something wrongly."""

import difflib

from rclpy.exceptions import InvalidParameterTypeException, InvalidTopicNameException
from rclpy.qos_overriding_options import InvalidQosOverridesError

from frac_accel.errors import FracAccelError

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


def did_you_mean(name, names):
    """Hint at the one of some names that is most like another, or nothing."""
    near = difflib.get_close_matches(name, names, 1)
    return f": did you mean '{near[0]}'?" if near else ""
