"""ROS 2 nodes: thin shells over the numerical code, and the only part that imports ROS."""

import importlib.util
import sys

from ..signals import one_thread

one_thread.prefer()

# While `python -m` looks for a node, and in the scripts that `ros2 run` starts, this is the
# program: it ends in one line.
_is_program = sys.argv[0] == "-m" or "lib/frac_accel/" in sys.argv[0]
if _is_program and importlib.util.find_spec("rclpy") is None:
    print("frac_accel: the nodes need ROS 2, and this Python has no rclpy: source "
          "/opt/ros/jazzy/setup.bash, or pip install 'frac_accel[ros]'", file=sys.stderr)
    raise SystemExit(2)
