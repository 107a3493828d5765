"""The corrector as a managed node, brought up: configured at once, active when it is configured.

Where it cannot be configured it stays unconfigured, and the log says why; a lifecycle manager, or
``ros2 lifecycle set``, may go on from there. With ``autostart:=false`` it waits for one. A process
that has died is started and brought up again; one that ends because of what it was given (exit
status 2) is not.

ros2 launch frac_accel managed.launch.py model_file:=sensor.yaml namespace:=chassis
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, LogInfo, RegisterEventHandler
from launch.conditions import IfCondition
from launch.event_handlers import OnProcessExit, OnProcessStart
from launch.events import matches_action
from launch.events.process import ShutdownProcess
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare
from lifecycle_msgs.msg import Transition

BAD_INPUT = 2


def generate_launch_description():
    """Declare the arguments, start the node and bring it up."""
    default_params = PathJoinSubstitution(
        [FindPackageShare("frac_accel"), "config", "corrector.yaml"])
    corrector = LifecycleNode(
        package="frac_accel",
        executable="managed_corrector",
        name=LaunchConfiguration("name"),
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params_file"),
            {"model_file": ParameterValue(LaunchConfiguration("model_file"), value_type=str),
             "use_sim_time": ParameterValue(LaunchConfiguration("use_sim_time"), value_type=bool)},
        ],
        remappings=[
            ("imu/data_raw", LaunchConfiguration("raw_topic")),
            ("imu/data", LaunchConfiguration("corrected_topic")),
            ("imu/reference", LaunchConfiguration("reference_topic")),
            ("imu/temperature", LaunchConfiguration("temperature_topic")),
        ],
        respawn=True,
        respawn_delay=2.0,
        output="screen",
    )
    autostart = IfCondition(LaunchConfiguration("autostart"))

    def ask(transition):
        return EmitEvent(condition=autostart, event=ChangeState(
            lifecycle_node_matcher=matches_action(corrector), transition_id=transition))

    def on_exit(event, _):
        if event.returncode != BAD_INPUT:
            return None
        return [LogInfo(msg="the corrector cannot run like this; it is not started again"),
                EmitEvent(event=ShutdownProcess(process_matcher=matches_action(corrector)))]

    return LaunchDescription([
        DeclareLaunchArgument("model_file", description="sensor model (YAML) to correct with"),
        DeclareLaunchArgument("params_file", default_value=default_params,
                              description="parameters of the corrector"),
        DeclareLaunchArgument("name", default_value="corrector", description="name of the node"),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of the node"),
        DeclareLaunchArgument("use_sim_time", default_value="false",
                              description="take the time from /clock"),
        DeclareLaunchArgument("raw_topic", default_value="imu/data_raw",
                              description="sensor_msgs/Imu to correct"),
        DeclareLaunchArgument("corrected_topic", default_value="imu/data",
                              description="corrected sensor_msgs/Imu"),
        DeclareLaunchArgument("reference_topic", default_value="imu/reference",
                              description="reference sensor_msgs/Imu, if there is one"),
        DeclareLaunchArgument("temperature_topic", default_value="imu/temperature",
                              description="sensor_msgs/Temperature of the sensor, if there is one"),
        DeclareLaunchArgument("autostart", default_value="true", choices=["true", "false"],
                              description="configure and activate it"),
        RegisterEventHandler(OnStateTransition(
            target_lifecycle_node=corrector, start_state="configuring", goal_state="inactive",
            entities=[ask(Transition.TRANSITION_ACTIVATE)])),
        RegisterEventHandler(OnProcessStart(
            target_action=corrector, on_start=[ask(Transition.TRANSITION_CONFIGURE)])),
        RegisterEventHandler(OnProcessExit(target_action=corrector, on_exit=on_exit)),
        corrector,
    ])
