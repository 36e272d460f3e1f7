"""Start the simulator: `ros2 launch alf_ros simulate.launch.py scene:=four_bar view:=true`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Launch argument: the node's parameter, its type, default, help. What is empty is not passed on.
ARGUMENTS = {
    'scene': ('scene', str, 'slider_crank', 'a name under config/scenes, or a path'),
    'rate': ('rate', float, '', 'messages per simulated second, Hz; empty: as the scene needs'),
    'record': ('record.enabled', bool, 'true', 'write an MCAP log'),
    'log_folder': ('record.folder', str, 'logs', 'where logs go'),
    'duration': ('duration', float, '0.0', 'simulated seconds to run; 0 runs until stopped'),
    'real_time_factor': ('real_time_factor', float, '1.0', '0 runs as fast as it can'),
    'start_paused': ('start_paused', bool, 'false', 'start paused'),
}
TRUE_FALSE = {'true': True, 'false': False}


def value(name, kind, text):
    """Return the text of an argument as its type; ValueError tells what was expected."""
    try:
        return TRUE_FALSE[text.lower()] if kind is bool else kind(text)
    except (KeyError, ValueError):
        expected = 'true or false' if kind is bool else 'a number'
        raise ValueError(f'{name}:={text}: expected {expected}') from None


def simulator(context):
    """Return the node: every argument that is given is one of its parameters."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    parameters = {
        parameter: value(name, kind, given[name])
        for name, (parameter, kind, _, _) in ARGUMENTS.items()
        if given[name]
    }
    # What looks on need not outlive it.
    ends = Shutdown(reason='the simulator ended')
    node = Node(
        package='alf_ros',
        executable='simulator',
        output='screen',
        parameters=[parameters],
        on_exit=ends,
    )
    return [node]


def generate_launch_description():
    """Describe the launch: the simulator, and what shows it if asked for."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (_, _, default, text) in ARGUMENTS.items()
    ]
    shown = [
        DeclareLaunchArgument(name, default_value='false', description=text)
        for name, text in (
            ('view', 'show it in a web browser, at http://localhost:8080'),
            ('rviz', 'show it in RViz'),
        )
    ]
    view = Node(
        package='alf_ros',
        executable='view',
        output='screen',
        condition=IfCondition(LaunchConfiguration('view')),
    )
    config = PathJoinSubstitution([FindPackageShare('alf_ros'), 'rviz', 'simulator.rviz'])
    rviz = Node(
        package='rviz2',
        executable='rviz2',
        arguments=['-d', config],
        condition=IfCondition(LaunchConfiguration('rviz')),
    )
    return LaunchDescription([*declared, *shown, OpaqueFunction(function=simulator), view, rviz])
