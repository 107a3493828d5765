"""A bag through the corrector into another bag: player, corrector, recorder; ends with the bag.

The exit status is not 0 where the bag could not be played. ``rate:=0.0`` plays as fast as the
corrector takes it; nothing is lost.

With ``simulate:=true`` the virtual sensor makes the raw signal from the bag's reference, and the
bag's own raw signal is played as ``/imu/data_raw_measured``.

ros2 launch frac_accel bench.launch.py bag:=pair.mcap model:=sensor.yaml output:=corrected.mcap
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, RegisterEventHandler, Shutdown, TimerAction
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

# The corrector's filter delay and the recorder's last flush fit into this.
DRAIN_S = 3.0


def generate_launch_description():
    """Declare the arguments, start the nodes and end with the player."""
    params = PathJoinSubstitution([FindPackageShare("frac_accel"), "config", "bench.yaml"])
    model = ParameterValue(LaunchConfiguration("model"), value_type=str)
    simulate = LaunchConfiguration("simulate")
    raw_of_bag = PythonExpression(
        ["'/imu/data_raw_measured' if '", simulate, "'.lower() == 'true' else '/imu/data_raw'"])

    recorder = Node(
        package="frac_accel", executable="recorder", name="recorder", output="screen",
        parameters=[
            params,
            {"bag": ParameterValue(LaunchConfiguration("output"), value_type=str)},
        ],
    )
    virtual_sensor = Node(
        package="frac_accel", executable="virtual_sensor", name="virtual_sensor", output="screen",
        parameters=[params, {"model_file": model}],
        condition=IfCondition(simulate),
    )
    corrector = Node(
        package="frac_accel", executable="corrector", name="corrector", output="screen",
        parameters=[params, {"model_file": model}],
    )
    player = Node(
        package="frac_accel", executable="player", name="player", output="screen",
        parameters=[
            params,
            {
                "bag": ParameterValue(LaunchConfiguration("bag"), value_type=str),
                "rate": ParameterValue(LaunchConfiguration("rate"), value_type=float),
            },
        ],
        remappings=[("/imu/data_raw", raw_of_bag)],
    )

    def on_end(event, _):
        if event.returncode:
            # what ends a launch with another exit status than 0
            raise RuntimeError(f"the bag was not played: exit status {event.returncode}")
        return [TimerAction(period=DRAIN_S, actions=[Shutdown(reason="the bag has been played")])]

    return LaunchDescription([
        DeclareLaunchArgument("bag", description="bag to play: .mcap file or rosbag2 folder"),
        DeclareLaunchArgument("model", description="sensor model (YAML)"),
        DeclareLaunchArgument("output", default_value="corrected.mcap",
                              description="bag to write"),
        DeclareLaunchArgument("rate", default_value="1.0", description="playback rate"),
        DeclareLaunchArgument("simulate", default_value="false", choices=["true", "false"],
                              description="make the raw signal from the reference"),
        RegisterEventHandler(OnProcessExit(target_action=player, on_exit=on_end)),
        recorder,
        virtual_sensor,
        corrector,
        player,
    ])
