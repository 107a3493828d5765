"""Stamps of the benchmark's samples; no ROS, since those who judge them read them, too."""

# Stamp of the first sample.
START_NS = 1_700_000_000 * 10**9
