"""A running node has exactly the interface of doc/ros_interface.md and config/security."""

import ast
import importlib.util
import os
import re
import subprocess
import urllib.request
from fnmatch import fnmatchcase
from xml.etree import ElementTree

import pytest
from rcl_interfaces.srv import ListParameters
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from alf_ros import load_scene
from alf_ros.scene.sensors_section import KINDS
from support.paths import ROOT
from support.ros_node import Diagnostics, Peer, SimulatorProcess
from support.view_process import ViewProcess

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
DOC = (ROOT / 'doc/ros_interface.md').read_text('utf-8')
# Names that stand for many.
ANY = {'body': r'\w+', 'point': r'\w+', 'kind': r'\w+', 'name': r'\w+', 'field': r'\w+'}
ANY['topic'] = '/[^.]+'


def table(section, column=1):
    """(names, another column) of each row of a section's tables."""
    text = DOC.partition(f'\n## {section}\n')[2].partition('\n## ')[0]
    rows = [line.strip('|').split('|') for line in text.splitlines() if line.startswith('| `')]
    assert rows, section
    return [(re.findall(r'`([^`]+)`', row[0]), row[column].strip()) for row in rows]


def resolved(name, node='simulator'):
    if name.startswith('~/'):
        return f'/{node}{name[1:]}'
    return name if name.startswith('/') else f'/{name}'


def pattern(name):
    parts = re.split(r'<(\w+)>', name)
    return ''.join(ANY[part] if n % 2 else re.escape(part) for n, part in enumerate(parts))


@pytest.fixture(scope='module')
def found(tmp_path_factory):
    """Publishers, subscribers and services by name, with their types, and all parameters."""
    options = {'qos_overrides./simulator/energy.publisher.reliability': 'best_effort'}
    process = SimulatorProcess(tmp_path_factory.mktemp('node'), **options)
    with Peer() as peer, process.wait_running():
        names = peer.call(ListParameters, '/simulator/list_parameters').result.names

        def graph(what):
            ask = getattr(peer.node, f'get_{what}_names_and_types_by_node')
            return dict(ask('simulator', '/'))

        def discovered():
            known = graph('publisher'), graph('subscriber'), graph('service')
            # the last of each that the node makes
            last = '/robot_description', '/simulator/wrench/B', '/simulator/restore_state'
            return all(name in names for name, names in zip(last, known, strict=True)) and known

        everything = peer.until(discovered, 'the node on the graph')
        reports = Diagnostics(peer)
        peer.until(lambda: reports.heard, 'diagnostics')
        tasks = {status.name.partition(': ')[2] for status in reports.heard[-1].status}
        offered = {topic: peer.node.get_publishers_info_by_topic(topic) for topic in everything[0]}
    profiles = {
        topic: info.qos_profile
        for topic, infos in offered.items()
        for info in infos
        if info.node_name == 'simulator'
    }
    return *everything, names, profiles, tasks


def test_topics(found):
    publishers, *_ = found
    documented = {resolved(names[0]): kind for names, kind in table('Topics')}
    try:
        import tf2_msgs.msg  # noqa: F401
    except ImportError:
        del documented['/tf']
    own = {name: kinds for name, kinds in publishers.items() if '/_action/' not in name}
    assert own == {name: [kind] for name, kind in documented.items()}


def test_quality_of_service_is_the_documented_one_or_that_asked_for(found):
    *_, profiles, _ = found
    for names, said in table('Topics', column=2):
        topic = resolved(names[0])
        if topic not in profiles or said == 'by rclpy':
            continue
        profile = profiles[topic]
        best_effort = said.startswith('best effort') or topic == '/simulator/energy'
        wanted = ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
        assert profile.reliability == wanted, topic
        latched = DurabilityPolicy.TRANSIENT_LOCAL
        assert (profile.durability == latched) == (said == 'latched'), topic


def test_commands(found):
    _, subscribers, *_ = found
    documented = {pattern(resolved(names[0])): kind for names, kind in table('Commands')[:5]}
    for name, kinds in subscribers.items():
        if name != '/parameter_events':  # rclpy's own, on some distributions
            (wanted,) = {kind for key, kind in documented.items() if re.fullmatch(key, name)}
            assert kinds == [wanted]
    mechanism = load_scene('slider_crank').mechanism
    names = {body.name for body in mechanism.bodies}
    names |= {point.name for point in mechanism.points if not point.fixed}
    wrenches = {f'/simulator/wrench/{name}' for name in names}
    assert {*wrenches, '/joint_commands'} <= set(subscribers)


def test_services(found):
    _, _, services, *_ = found
    documented = {resolved(name): kind for names, kind in table('Services') for name in names}
    own = {name: kinds for name, kinds in services.items() if '/_action/' not in name}
    if importlib.util.find_spec('simulation_interfaces') is None:
        documented = {k: v for k, v in documented.items() if 'simulation_interfaces' not in v}
        assert own == services
    else:
        # Releases differ in what they have.
        has = vars(importlib.import_module('simulation_interfaces.srv'))
        documented = {
            name: kind
            for name, kind in documented.items()
            if 'simulation_interfaces' not in kind or kind.rpartition('/')[2] in has
        }
        actions = {name.partition('/_action/')[0] for name in services.keys() - own.keys()}
        assert actions == {'/simulator/simulate_steps'} and '`~/simulate_steps`' in DOC
    assert set(own) == set(documented)
    for name, kinds in own.items():
        assert kinds[0].startswith(documented[name].rstrip('…'))


def test_parameters(found):
    *_, names, _, _ = found
    documented = {name for listed, _ in table('Parameters') for name in listed}
    for name in names:
        assert any(re.fullmatch(pattern(key), name) for key in documented), name
    # rclpy has the second one since Jazzy only
    for key in documented - {'start_type_description_service', 'effects.<kind>.<name>.<field>'}:
        assert any(re.fullmatch(pattern(key), name) for name in names), key


def test_tasks_of_the_diagnostics(found):
    *_, tasks = found
    documented = {names[0] for names, _ in table('Diagnostics')}
    assert documented - tasks == {'work'}  # with a ledger
    assert tasks <= documented


def test_launch_arguments():
    documented = {name for names, _ in table('Launch') for name in names}
    tree = ast.parse((ROOT / 'launch/simulate.launch.py').read_text('utf-8'))
    (given,) = (
        [ast.literal_eval(key) for key in node.value.keys if key]
        for node in tree.body
        if isinstance(node, ast.Assign)
        and isinstance(node.value, ast.Dict)
        and ast.unparse(node.targets[0]) == 'ARGUMENTS'
    )
    used = {
        node.args[0].value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) == 'LaunchConfiguration'
        and isinstance(node.args[0], ast.Constant)
    }
    assert documented == {*given, *used}
    text = DOC.partition('\n## Launch\n')[2].partition('\n## ')[0]
    for file in (ROOT / 'launch').glob('*.launch.py'):
        assert file.name in text


def test_exit_codes():
    """The cases of each code are in test_node_faults, test_recording and test_input_errors."""
    head = DOC.partition('\n## ')[0]
    assert re.findall(r'^\| `(\d)` \|', head, re.MULTILINE) == ['0', '1', '2']


def test_reasons_of_refusals():
    from alf_ros.ros.simulator.command_messages import REASONS

    documented = {name for names, _ in table('Commands')[5:] for name in names}
    assert set(REASONS) <= documented


def rules(enclave, node):
    """The profile of a node, and what tells which of its rules names do not need."""
    policy = ElementTree.parse(ROOT / 'config/security/simulator.policy.xml')
    profiles = policy.findall(f"enclaves/enclave[@path='/alf_ros/{enclave}']/profiles/profile")
    (profile,) = [found for found in profiles if found.get('node') == node]
    assert profile.get('ns') == '/'

    def unused(names, kind, access):
        """Rules that match no name; every name must match a rule."""
        groups = [group for group in profile.findall(kind) if group.get(access) == 'ALLOW']
        allowed = {resolved(item.text, node) for group in groups for item in group}
        for name in names:
            assert any(fnmatchcase(name, rule) for rule in allowed), f'{access} {name}'
        return {rule for rule in allowed if not any(fnmatchcase(name, rule) for name in names)}

    return profile, unused


def test_the_security_policy_lets_the_node_do_what_it_does_and_no_more(found):
    publishers, subscribers, services, *_ = found
    profile, unused = rules('simulator', 'simulator')

    def topics(names):
        """Without those that make up an action."""
        return [name for name in names if '/_action/' not in name]

    # tf needs tf2_msgs; rclpy reads parameter events on some distributions only
    sensors = {f'/simulator/{kind}*' for kind in KINDS}  # the scene has none
    assert unused(topics(publishers), 'topics', 'publish') <= {'/tf', *sensors}
    assert unused(subscribers, 'topics', 'subscribe') <= {
        '/parameter_events',
        '/cmd_vel',
        '/diagnostics',  # to hear a second node of its name
    }
    # what needs simulation_interfaces
    standard = {resolved(n) for names, kind in table('Services') for n in names if 'sim' in kind}
    assert unused(topics(services), 'services', 'reply') <= standard
    (action,) = profile.findall('actions')
    assert [(action.get('execute'), item.text) for item in action] == [
        ('ALLOW', '~/simulate_steps')
    ]


def test_the_security_policy_lets_the_view_do_what_it_does_and_no_more():
    _, unused = rules('view', 'view')
    with Peer() as peer, ViewProcess() as view, urllib.request.urlopen(f'{view.url}events'):

        def of_view(what):
            return dict(getattr(peer.node, f'get_{what}_names_and_types_by_node')('view', '/'))

        # the last of each that it makes
        peer.until(lambda: '/diagnostics' in of_view('subscriber'), 'its subscriptions')
        peer.until(lambda: '/joint_commands' in of_view('publisher'), 'its publishers')
        peer.until(lambda: '/simulator/set_parameters' in of_view('client'), 'its clients')
        subscribers = of_view('subscriber')
        assert unused(subscribers, 'topics', 'subscribe') <= {'/parameter_events'}
        assert unused(of_view('publisher'), 'topics', 'publish') == set()
        assert unused(of_view('client'), 'services', 'request') == set()


@pytest.mark.parametrize(('given', 'found'), [({}, 'LOCALHOST'), ({RANGE: 'SUBNET'}, 'SUBNET')])
def test_make_run_stays_on_this_machine_unless_told_otherwise(given, found):
    own = {k: v for k, v in os.environ.items() if k != RANGE and not k.startswith('MAKE')}
    environment = {**own, **given}
    show = f'show: ; @echo $${RANGE}'
    command = ['make', '--no-print-directory', '-C', str(ROOT), f'--eval={show}', 'show']
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == found
