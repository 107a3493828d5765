"""ROS 2 nodes: thin shells over the numerical code, and the only part that imports ROS."""

from ..signals import one_thread

one_thread.prefer()
