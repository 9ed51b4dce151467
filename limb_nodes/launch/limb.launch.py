"""The nodes of one limb: `ros2 launch limb_nodes limb.launch.py params_file:=params/nodes/knee.yaml`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def end_if_failed(event, _):
    """End all nodes if one could not do its part: the others would wait for it."""
    if event.returncode:
        why = f"{event.process_name} ended with status {event.returncode}"
        return [LogInfo(msg=f"{why}; the other nodes end, too"), Shutdown(reason=why)]
    return None


def generate_launch_description() -> LaunchDescription:
    """Start the four nodes, the recorder if it is wanted, with one file of parameters."""
    arguments = [
        DeclareLaunchArgument("params_file", description="file of parameters, as params/nodes/knee.yaml"),
        DeclareLaunchArgument("namespace", default_value="", description="of all nodes"),
        DeclareLaunchArgument("record", default_value="true", description="whether the recorder is started too"),
    ]
    nodes = [
        Node(
            package="limb_nodes",
            executable=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[LaunchConfiguration("params_file")],
            output="screen",
            on_exit=end_if_failed,
            condition=IfCondition(LaunchConfiguration("record") if name == "recorder" else "true"),
        )
        for name in ("activation_input", "muscle_stack", "limb_dynamics", "recorder")
    ]
    return LaunchDescription([*arguments, *nodes])
