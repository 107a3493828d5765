#!/bin/bash
# Runs a command in the built workspace.
set -e
. /opt/ros/jazzy/setup.bash
. /workspace/install/setup.bash
exec "$@"
