"""The simulator under ros2_control: a joint_trajectory_controller moves its motors.

`ros2 launch alf_ros ros2_control.launch.py mechanism:=delta_robot` takes the arguments of
simulate.launch.py. It needs controller_manager, joint_trajectory_controller and
topic_based_ros2_control, which package.xml does not ask for. A mechanism with an `.xml` and a
`.yaml` in config/ros2_control can be launched.
"""

from pathlib import Path
from xml.etree import ElementTree

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

from alf_ros import load_scene, resources
from alf_ros.exchange.urdf_export import urdf

MECHANISMS = sorted(resources.library('ros2_control'))


def scene_of(mechanism):
    """Return the name of its scene with motors: <mechanism>_controlled, or the mechanism's own."""
    controlled = f'{mechanism}_controlled'
    return controlled if controlled in resources.library('scenes') else mechanism


def description(mechanism, folder):
    """Return the URDF of the scene of a mechanism, with its `<ros2_control>` block.

    The controller manager looks up the joints of the block in the tree.
    """
    block = ElementTree.parse(Path(folder) / f'{mechanism}.xml').getroot()
    joints = {joint.get('name') for joint in block.findall('joint')}
    scene = load_scene(scene_of(mechanism))
    robot = ElementTree.fromstring(urdf(scene.mechanism, keep=joints))
    robot.append(block)
    return ElementTree.tostring(robot, encoding='unicode')


def nodes(context):
    """Return the simulator, the controller manager, and what starts its controller."""
    mechanism = LaunchConfiguration('mechanism').perform(context)
    namespace = LaunchConfiguration('namespace').perform(context)
    share = FindPackageShare('alf_ros').perform(context)
    folder = f'{share}/config/ros2_control'
    file = PathJoinSubstitution([share, 'launch', 'simulate.launch.py'])
    scene = {'scene': scene_of(mechanism)}
    simulate = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(file), launch_arguments=scene.items()
    )
    robot = {'robot_description': ParameterValue(description(mechanism, folder), value_type=str)}
    # The simulated time is on the relative topic `clock`.
    renamed = [('/clock', 'clock')]
    manager = Node(
        package='controller_manager',
        executable='ros2_control_node',
        namespace=namespace,
        parameters=[robot, f'{folder}/{mechanism}.yaml', {'use_sim_time': True}],
        remappings=renamed,
    )
    spawner = Node(
        package='controller_manager',
        executable='spawner',
        namespace=namespace,
        arguments=['joint_trajectory_controller'],
    )
    return [simulate, manager, spawner]


def generate_launch_description():
    """Describe the launch: simulate.launch.py, a controller manager and its controller."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                'mechanism',
                default_value='delta_robot',
                choices=MECHANISMS,
                description='whose scene with motors, and controllers',
            ),
            DeclareLaunchArgument('namespace', default_value='', description='of all its nodes'),
            OpaqueFunction(function=nodes),
        ]
    )
