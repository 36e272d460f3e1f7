"""The simulator and a robot_state_publisher with its URDF: a tf tree and a RobotModel in RViz.

`ros2 launch alf_ros with_robot_state_publisher.launch.py scene:=four_bar rviz:=true` takes the
arguments of simulate.launch.py.
"""

from launch import LaunchDescription
from launch.actions import IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from alf_ros import load_scene
from alf_ros.exchange.urdf_export import urdf


def robot_state_publisher(context):
    """Return the node; it wants the URDF at its start, so the scene is read here as well."""
    given = {
        name: LaunchConfiguration(name, default='').perform(context)
        for name in ('scene', 'namespace', 'frame_prefix')
    }
    scene = load_scene(given['scene'] or 'slider_crank')
    text = urdf(scene.mechanism, given['frame_prefix'])
    parameters = {
        'robot_description': ParameterValue(text, value_type=str),
        # Without it, it would take a reset for time that stands still.
        'use_sim_time': True,
    }
    node = Node(
        package='robot_state_publisher',
        executable='robot_state_publisher',
        namespace=given['namespace'],
        parameters=[parameters],
        remappings=[
            # The simulator says robot_description, also when another scene is loaded.
            ('robot_description', '~/robot_description'),
            # Time and frames of the simulator are those of its namespace.
            ('/clock', 'clock'),
            ('/tf', 'tf'),
            ('/tf_static', 'tf_static'),
        ],
    )
    return [node]


def generate_launch_description():
    """Describe the launch: simulate.launch.py, and what makes a tf tree of its joint_states."""
    file = PathJoinSubstitution([FindPackageShare('alf_ros'), 'launch', 'simulate.launch.py'])
    simulate = IncludeLaunchDescription(PythonLaunchDescriptionSource(file))
    return LaunchDescription([simulate, OpaqueFunction(function=robot_state_publisher)])
