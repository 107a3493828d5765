# Copied into .venv as the setup file of the ROS wheels, which bring none: install/setup.bash reads
# it, so that the ament index of the message packages is found after sourcing only that.
case ":$AMENT_PREFIX_PATH:" in
    *":$COLCON_CURRENT_PREFIX:"*) ;;
    *) export AMENT_PREFIX_PATH="${AMENT_PREFIX_PATH:+$AMENT_PREFIX_PATH:}$COLCON_CURRENT_PREFIX" ;;
esac
