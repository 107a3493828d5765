"""The corrector's process loads what it runs, and nothing else: it is to start in no time."""

import subprocess
import sys

import pytest

pytest.importorskip("rclpy")

pytestmark = pytest.mark.ros

PROGRAM = """
import sys
import numpy as np
from frac_accel.nodes import corrector
from frac_accel.streaming import Corrector
from frac_accel.model import SensorModel
model = SensorModel.from_dict({"schema": "frac_accel/sensor_model/1", "core": {
    "natural_frequency_hz": 150.0, "damping_ratio": 0.3, "damping_order": 0.7},
    "effects": [{"cause": "low_pass_lag", "corner_hz": 400.0}],
    "covariance": {"parameters": ["damping_ratio"], "matrix": [[1e-4]]}})
Corrector(model, 1000.0).process(np.arange(200) * 10**6, np.ones((200, 3)))
print(*sorted(name for name in sys.modules if name.startswith("frac_accel")
              or name.partition(".")[0] not in sys.stdlib_module_names))
"""
# What the node's own packages bring along.
ROS = {"rclpy", "rcl_interfaces", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs",
       "lifecycle_msgs", "rosgraph_msgs", "rosidl_parser", "rpyutils", "sensor_msgs",
       "service_msgs", "std_msgs", "std_srvs", "type_description_interfaces",
       "unique_identifier_msgs", "ament_index_python", "ros_wheels_bootstrapper", "action_msgs"}
UNUSED = ("identification", "diagnosis", "report", "paper", "commands", "io.bag", "bench",
          "validation", "simulation", "nodes.player", "nodes.recorder")


def test_a_corrector_at_work_has_imported_nothing_that_it_does_not_use():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    loaded = set(done.stdout.split())
    assert not [name for name in loaded for part in UNUSED if name.startswith(f"frac_accel.{part}")]
    packages = {name.partition(".")[0] for name in loaded if not name.startswith("_")}
    assert packages - ROS <= {"frac_accel", "numpy", "scipy", "yaml", "cython_runtime"}
    # of scipy, one compiled function; its packages take a second to import
    assert not {name for name in loaded if name.startswith("scipy.") and name.count(".") == 1} \
        & {"scipy.signal", "scipy.stats", "scipy.optimize", "scipy.special", "scipy.linalg",
           "scipy.fft", "scipy.ndimage"}
