"""The diagnoser beside a corrector: says whether, how, why and since when the sensor has changed.

One that ends because of what it was given (exit status 2) is not started again.

ros2 launch frac_accel diagnoser.launch.py model_file:=sensor.yaml results:=/var/lib/frac_accel
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, LogInfo, RegisterEventHandler
from launch.event_handlers import OnProcessExit
from launch.events import matches_action
from launch.events.process import ShutdownProcess
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

BAD_INPUT = 2


def generate_launch_description():
    """Declare the arguments and start the diagnoser."""
    default_params = PathJoinSubstitution(
        [FindPackageShare("frac_accel"), "config", "diagnoser.yaml"])
    diagnoser = Node(
        package="frac_accel",
        executable="diagnoser",
        name="diagnoser",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params_file"),
            {"model_file": ParameterValue(LaunchConfiguration("model_file"), value_type=str),
             "results": ParameterValue(LaunchConfiguration("results"), value_type=str),
             "axis": ParameterValue(LaunchConfiguration("axis"), value_type=str),
             "corrector": ParameterValue(LaunchConfiguration("corrector"), value_type=str),
             "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)},
        ],
        remappings=[
            ("imu/data_raw", LaunchConfiguration("raw_topic")),
            ("imu/reference", LaunchConfiguration("reference_topic")),
        ],
        respawn=True,
        respawn_delay=2.0,
        output="screen",
    )

    def on_exit(event, _):
        if event.returncode != BAD_INPUT:
            return None
        return [LogInfo(msg="the diagnoser cannot run like this; it is not started again"),
                EmitEvent(event=ShutdownProcess(process_matcher=matches_action(diagnoser)))]

    return LaunchDescription([
        DeclareLaunchArgument("model_file", description="sensor model (YAML) of the corrector"),
        DeclareLaunchArgument("params_file", default_value=default_params,
                              description="parameters of the diagnoser"),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
        DeclareLaunchArgument("results", default_value="diagnoser_results",
                              description="folder for what is found"),
        DeclareLaunchArgument("axis", default_value="x", choices=["x", "y", "z"],
                              description="axis that is watched"),
        DeclareLaunchArgument("corrector", default_value="corrector",
                              description="node that may be given another model"),
        DeclareLaunchArgument("use_sim_time", default_value="false",
                              description="take the time from /clock"),
        DeclareLaunchArgument("raw_topic", default_value="imu/data_raw",
                              description="sensor_msgs/Imu that is watched"),
        DeclareLaunchArgument("reference_topic", default_value="imu/reference",
                              description="sensor_msgs/Imu of the trusted accelerometer"),
        RegisterEventHandler(OnProcessExit(target_action=diagnoser, on_exit=on_exit)),
        diagnoser,
    ])
