"""Robots in other formats, of the sizes of our own mechanism files."""

from __future__ import annotations

import math

from alf_ros import load_scene


def link(name: str, com: tuple[float, ...], mass: float, inertia: tuple[float, ...]) -> str:
    """A URDF link; inertia ixx, iyy, izz, ixy, ixz, iyz in its frame."""
    names = ('ixx', 'iyy', 'izz', 'ixy', 'ixz', 'iyz')
    tensor = ' '.join(f'{key}="{value!r}"' for key, value in zip(names, inertia, strict=True))
    xyz = ' '.join(map(repr, com))
    return f"""<link name="{name}"><inertial><origin xyz="{xyz}"/><mass value="{mass!r}"/>
 <inertia {tensor}/></inertial><visual><geometry><sphere radius="1"/></geometry></visual></link>"""


def rod(name: str, length: float, mass: float) -> str:
    """A slender rod along x."""
    J = mass * length**2 / 12.0
    return link(name, (length / 2, 0.0, 0.0), mass, (0.0, J, J, 0.0, 0.0, 0.0))


def hinge(
    name: str, parent: str, child: str, x: float, turn: float, kind: str = 'continuous'
) -> str:
    """A joint at x along the parent's bar, about -y: positive as about z in the x-y plane."""
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
 <origin xyz="{x!r} 0 0" rpy="0 {-turn!r} 0"/><axis xyz="0 -1 0"/></joint>"""


def robot(*elements: str) -> str:
    return '\n'.join(['<?xml version="1.0"?>', '<robot name="robot">', *elements, '</robot>'])


def double_pendulum() -> str:
    """config/mechanisms/double_pendulum.yaml in the x-z plane."""
    return robot(
        '<link name="world"/>',
        rod('upper', 1.0, 1.0),
        rod('lower', 0.8, 1.0),
        hinge('shoulder', 'world', 'upper', 0.0, 0.0),
        hinge('elbow', 'upper', 'lower', 1.0, math.pi / 2),
    )


def four_bar_angles() -> tuple[float, float, float]:
    """Angles of crank, coupler and rocker of config/mechanisms/four_bar.yaml as drawn."""
    places = {point.name: point.at for point in load_scene('four_bar').mechanism.points}

    def angle(one: str, other: str) -> float:
        (x, y), (u, v) = places[one], places[other]
        return math.atan2(v - y, u - x)

    return angle('O', 'A'), angle('A', 'B'), angle('C', 'B')


CRANK, COUPLER, ROCKER, GROUND, DENSITY = 0.10, 0.30, 0.25, 0.30, 0.54


def four_bar(*closed_by: str) -> str:
    """config/mechanisms/four_bar.yaml in the x-z plane, open at the joint `wrist`."""
    one, two, three = four_bar_angles()
    return robot(
        '<link name="base"/>',
        rod('crank', CRANK, DENSITY * CRANK),
        rod('coupler', COUPLER, DENSITY * COUPLER),
        rod('rocker', ROCKER, DENSITY * ROCKER),
        hinge('crank_pin', 'base', 'crank', 0.0, one),
        hinge('knee', 'crank', 'coupler', CRANK, two - one),
        hinge('rocker_pin', 'base', 'rocker', GROUND, three),
        *closed_by,
    )


BY_GAZEBO = f"""<gazebo><joint name="wrist" type="revolute">
 <parent>coupler</parent><child>rocker</child><pose>{ROCKER} 0 0 0 0 0</pose>
 <axis><xyz>0 -1 0</xyz></axis></joint></gazebo>"""
BY_CONSTRAINT = f"""<constraint name="wrist" type="revolute">
 <parent link="coupler"/><parent_origin xyz="{COUPLER} 0 0"/><parent_axis xyz="0 -1 0"/>
 <child link="rocker"/><child_origin xyz="{ROCKER} 0 0"/><child_axis xyz="0 -1 0"/></constraint>"""
BY_FILE = f"""loops:
  wrist: {{type: revolute, between: [coupler, rocker], at: [{COUPLER}, 0, 0], axis: [0, -1, 0]}}
"""


def four_bar_mjcf() -> str:
    """The same in MJCF, closed by `connect`."""
    one, two, three = map(math.degrees, four_bar_angles())

    def body(name: str, x: float, turn: float, length: float, joint: str, inner: str) -> str:
        mass = DENSITY * length
        J = mass * length**2 / 12.0
        return f"""<body name="{name}" pos="{x!r} 0 0" euler="0 {-turn!r} 0">
 <joint name="{joint}" axis="0 -1 0"/>
 <inertial pos="{length / 2!r} 0 0" mass="{mass!r}" diaginertia="{J / 2!r} {J!r} {J!r}"/>
 {inner}</body>"""

    coupler = body('coupler', CRANK, two - one, COUPLER, 'knee', '')
    return f"""<mujoco model="four_bar"><worldbody>
{body('crank', 0.0, one, CRANK, 'crank_pin', coupler)}
{body('rocker', GROUND, three, ROCKER, 'rocker_pin', '')}</worldbody>
<equality><connect name="wrist" body1="coupler" body2="rocker" anchor="{COUPLER} 0 0"/></equality>
</mujoco>"""


BALL_JOINT = '<joint name="ball" type="ball" pos="0 0.05 0"/>'
CHAIN = f"""<mujoco model="chain"><compiler angle="radian"/>
<option timestep="1e-4" integrator="RK4" gravity="0.3 -1 -9.81"><flag contact="disable"/></option>
<default><geom density="700"/></default>
<worldbody><light pos="0 0 3"/><geom type="plane" size="5 5 1"/>
<body name="base" pos="0.1 0.2 1" euler="0.1 0.2 0.3">
 <joint name="yaw" axis="0.1 0.2 1" damping="0.2"/>
 <geom type="box" size="0.1 0.2 0.05" pos="0.1 0 0" euler="0.4 0.2 0.1"/>
 <body name="arm" pos="0.2 0.1 0.05" quat="0.9 0.1 0.3 0.2">
  <joint name="pitch" pos="0.05 0.02 0" axis="0 1 0.3" stiffness="3" springref="0.2"/>
  <inertial pos="0.2 0.01 0.02" mass="1.5" fullinertia="0.03 0.06 0.07 0.004 -0.005 0.006"/>
  <body name="tool" pos="0.4 0 0.1"><geom size="0.08" pos="0.1 0.1 0"/></body>
  <body name="carriage" pos="0.5 0 0" euler="0.5 0 0.2">
   <joint name="x" type="slide" axis="1 0.2 0" damping="4"/>
   <joint name="roll" axis="1 0 0"/><joint name="tilt" axis="0.2 1 0"/>
   <geom type="capsule" fromto="0 0 0 0.1 0.3 0.1" size="0.04"/>
   <body name="bob" pos="0 0.3 0">{BALL_JOINT}
    <geom type="ellipsoid" size="0.1 0.05 0.07" pos="0.1 0.1 -0.1"/></body></body></body></body>
</worldbody></mujoco>"""

# two links and a hinge
SDF = """<sdf version="1.9"><model name="m">
<link name="a"><inertial>
<mass>1</mass></inertial></link>
<link name="b">
<pose relative_to="a">1 0 0 0 0 0</pose></link>
<joint name="q" type="revolute"><parent>a</parent>
<child>b</child><axis>
<xyz>0 1 0</xyz>
<limit><lower>-1</lower></limit></axis></joint>
</model></sdf>"""
