"""The corrector on a vehicle: raw acceleration in, corrected out; started again when it dies.

ros2 launch frac_accel vehicle.launch.py model_file:=sensor.yaml namespace:=chassis
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare


def generate_launch_description():
    """Declare the arguments and start the corrector."""
    default_params = PathJoinSubstitution(
        [FindPackageShare("frac_accel"), "config", "corrector.yaml"])
    return LaunchDescription([
        DeclareLaunchArgument("model_file", description="sensor model (YAML) to correct with"),
        DeclareLaunchArgument("params_file", default_value=default_params,
                              description="parameters of the corrector"),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
        DeclareLaunchArgument("raw_topic", default_value="imu/data_raw",
                              description="sensor_msgs/Imu to correct"),
        DeclareLaunchArgument("corrected_topic", default_value="imu/data",
                              description="corrected sensor_msgs/Imu"),
        DeclareLaunchArgument("reference_topic", default_value="imu/reference",
                              description="reference sensor_msgs/Imu, if there is one"),
        Node(
            package="frac_accel",
            executable="corrector",
            name="corrector",
            namespace=LaunchConfiguration("namespace"),
            parameters=[
                LaunchConfiguration("params_file"),
                {"model_file": ParameterValue(LaunchConfiguration("model_file"), value_type=str)},
            ],
            remappings=[
                ("imu/data_raw", LaunchConfiguration("raw_topic")),
                ("imu/data", LaunchConfiguration("corrected_topic")),
                ("imu/reference", LaunchConfiguration("reference_topic")),
            ],
            respawn=True,
            respawn_delay=2.0,
            output="screen",
        ),
    ])
