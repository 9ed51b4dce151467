"""Two limbs in the namespaces left and right, each with its own file of parameters."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration


def generate_launch_description() -> LaunchDescription:
    """Include limb.launch.py once for each side."""
    one = str(Path(__file__).with_name("limb.launch.py"))
    sides = ("left", "right")
    arguments = [
        DeclareLaunchArgument(f"{side}_params_file", description=f"file of parameters of the {side} limb")
        for side in sides
    ]
    arguments.append(DeclareLaunchArgument("record", default_value="true", description="whether bags are recorded"))
    limbs = [
        IncludeLaunchDescription(
            # A source gives its nodes once.
            PythonLaunchDescriptionSource(one),
            launch_arguments={
                "namespace": side,
                "params_file": LaunchConfiguration(f"{side}_params_file"),
                "record": LaunchConfiguration("record"),
            }.items(),
        )
        for side in sides
    ]
    return LaunchDescription([*arguments, *limbs])
