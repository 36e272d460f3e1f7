"""Start the simulator: `ros2 launch alf_ros simulate.launch.py scene:=four_bar`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Launch argument: the node's parameter, its type, default, help.
ARGUMENTS = {
    'scene': ('scene', str, 'slider_crank', 'a name under config/scenes, or a path'),
    'duration': ('duration', float, '0.0', 'simulated seconds to run; 0 runs until stopped'),
    'real_time_factor': ('real_time_factor', float, '1.0', '0 runs as fast as it can'),
    'log_folder': ('record.folder', str, 'logs', 'where logs go'),
}


def generate_launch_description():
    """Describe the launch: one node, each argument one of its parameters."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (_, _, default, text) in ARGUMENTS.items()
    ]
    parameters = {
        parameter: ParameterValue(LaunchConfiguration(name), value_type=kind)
        for name, (parameter, kind, _, _) in ARGUMENTS.items()
    }
    simulator = Node(
        package='alf_ros', executable='simulator', output='screen', parameters=[parameters]
    )
    return LaunchDescription([*declared, simulator])
