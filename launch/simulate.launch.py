"""Start the simulator: `ros2 launch alf_ros simulate.launch.py scene:=four_bar view:=true`."""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

# Launch argument: the node's parameter, its type, default, help. What is empty is not passed on.
ARGUMENTS = {
    'scene': ('scene', str, '', 'a name under config/scenes, or a path; empty: slider_crank'),
    'rate': ('rate', float, '', 'messages per simulated second, Hz; empty: as the scene needs'),
    'record': ('record.enabled', bool, '', 'write an MCAP log; empty: true'),
    'log_folder': ('record.folder', str, '', 'where logs go; empty: logs'),
    'duration': ('duration', float, '', 'simulated seconds to run; 0 or empty: until stopped'),
    'real_time_factor': ('real_time_factor', float, '', '0 as fast as it can; empty: 1'),
    'start_paused': ('start_paused', bool, '', 'start paused; empty: false'),
    'frame_prefix': ('frame_prefix', str, '', 'before the names of frames, such as left/'),
}
SHOWN = 'simulator/markers', 'robot_description', 'tf', 'tf_static'
TRUE_FALSE = {'true': True, 'false': False}


def value(name, kind, text):
    """Return the text of an argument as its type; ValueError names the expected type."""
    try:
        return TRUE_FALSE[text.lower()] if kind is bool else kind(text)
    except (KeyError, ValueError):
        expected = 'true or false' if kind is bool else 'a number'
        raise ValueError(f'{name}:={text}: expected {expected}') from None


def simulator(context):
    """Return the node: every argument that is given is one of its parameters.

    An argument comes before the value in params_file, which comes before the default.
    """
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    parameters = {
        parameter: value(name, kind, given[name])
        for name, (parameter, kind, _, _) in ARGUMENTS.items()
        if given[name]
    }
    file = LaunchConfiguration('params_file').perform(context)
    # What looks on need not outlive it.
    ends = Shutdown(reason='the simulator ended')
    node = Node(
        package='alf_ros',
        executable='simulator',
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        parameters=([file] if file else []) + ([parameters] if parameters else []),
        on_exit=ends,
    )
    return [node]


def generate_launch_description():
    """Describe the launch: the simulator, and what shows it if asked for."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (_, _, default, text) in ARGUMENTS.items()
    ]
    others = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, default, text in (
            ('namespace', '', 'of the simulator and of what shows it, such as left'),
            ('params_file', '', 'parameters of the simulator, a copy of config/simulator.yaml'),
            ('view', 'false', 'show it in a web browser, at http://localhost:<view_port>'),
            ('view_port', '8080', 'port of the page of view'),
            ('rviz', 'false', 'show it in RViz'),
        )
    ]
    view = Node(
        package='alf_ros',
        executable='view',
        namespace=LaunchConfiguration('namespace'),
        output='screen',
        arguments=['--port', LaunchConfiguration('view_port')],
        condition=IfCondition(LaunchConfiguration('view')),
    )
    config = PathJoinSubstitution([FindPackageShare('alf_ros'), 'rviz', 'simulator.rviz'])
    rviz = Node(
        package='rviz2',
        executable='rviz2',
        namespace=LaunchConfiguration('namespace'),
        arguments=['-d', config],
        # The topics of the configuration are those without a namespace.
        remappings=[(f'/{name}', name) for name in SHOWN],
        condition=IfCondition(LaunchConfiguration('rviz')),
    )
    return LaunchDescription([*declared, *others, OpaqueFunction(function=simulator), view, rviz])
