"""The corrector before imu_tools' Madgwick filter, which uses the same names of topics.

Raw on imu/data_raw, corrected on imu/data_corrected, with an orientation on imu/data: as a stack
without the corrector has it.

ros2 launch frac_accel imu_filter.launch.py model_file:=sensor.yaml namespace:=chassis
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

CORRECTED = "imu/data_corrected"


def generate_launch_description():
    """Declare the arguments and start corrector and filter."""
    vehicle = PathJoinSubstitution(
        [FindPackageShare("frac_accel"), "launch", "vehicle.launch.py"])
    return LaunchDescription([
        DeclareLaunchArgument("model_file", description="sensor model (YAML) to correct with"),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of both"),
        DeclareLaunchArgument("use_mag", default_value="false",
                              description="whether the filter reads imu/mag"),
        DeclareLaunchArgument("use_sim_time", default_value="false",
                              description="take the time of both from /clock"),
        IncludeLaunchDescription(
            PythonLaunchDescriptionSource(vehicle),
            launch_arguments={"model_file": LaunchConfiguration("model_file"),
                              "namespace": LaunchConfiguration("namespace"),
                              "use_sim_time": LaunchConfiguration("use_sim_time"),
                              "corrected_topic": CORRECTED}.items()),
        Node(
            package="imu_filter_madgwick",
            executable="imu_filter_madgwick_node",
            name="imu_filter",
            namespace=LaunchConfiguration("namespace"),
            parameters=[{"use_mag": LaunchConfiguration("use_mag"),
                         "use_sim_time": LaunchConfiguration("use_sim_time")}],
            remappings=[("imu/data_raw", CORRECTED)],
            output="screen",
        ),
    ])
