"""Robot files: URDF and MJCF with other attributes, elements and nesting, USD with other words."""

from __future__ import annotations

import re
from random import Random
from xml.etree import ElementTree

from spoiling import TEXTS, damaged, number, scratch

URDF = """<robot name="arm">
<link name="base"/>
<link name="upper"><inertial><origin xyz="0 0 0.5" rpy="0 0 0"/><mass value="1.0"/>
<inertia ixx="0.1" iyy="0.1" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="lower"><inertial><origin xyz="0 0 0.4"/><mass value="0.7"/>
<inertia ixx="0.05" iyy="0.05" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 1" rpy="0 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz="0 0 1"/><axis xyz="0 1 0"/><dynamics damping="0.1" friction="0.0"/></joint>
<joint name="wrist" type="fixed"><parent link="lower"/><child link="tool"/>
<origin xyz="0 0 0.8"/></joint>
</robot>"""
MJCF = """<mujoco model="bar"><compiler angle="radian"/>
<worldbody><body name="crank" pos="0 0 0"><joint name="a" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.02" mass="1"/>
<body name="rod" pos="0 0 1"><joint name="b" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 1 0 0" size="0.02" mass="1"/></body></body>
<body name="rocker" pos="1 0 0"><joint name="c" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 1" size="0.02" mass="1"/></body></worldbody>
<equality><connect body1="rod" body2="rocker" anchor="1 0 0"/></equality></mujoco>"""

USD = """#usda 1.0
(
    metersPerUnit = 0.01
    upAxis = "Z"
)
def Xform "crank" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
{
    double3 xformOp:translate = (0, 0, 10)
    quatf xformOp:orient = (0.8, 0, 0.6, 0)
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]
    float physics:mass = 1
    float3 physics:diagonalInertia = (100, 100, 50)
    vector3f physics:angularVelocity = (0, 90, 0)
    def Capsule "bar" (prepend apiSchemas = ["PhysicsCollisionAPI"])
    {
        double height = 20
        double radius = 1.5
        color3f[] primvars:displayColor = [(0.2, 0.4, 0.8)]
    }
}
def Xform "rod" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])
{
    def Cube "box" (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])
    {
        double size = 4
        float physics:density = 0.001
    }
}
def PhysicsRevoluteJoint "a" (prepend apiSchemas = ["PhysicsDriveAPI:angular"])
{
    rel physics:body1 = </crank>
    point3f physics:localPos0 = (0, 0, 10)
    uniform token physics:axis = "Y"
    float physics:lowerLimit = -90
    float physics:upperLimit = 170
    float drive:angular:physics:stiffness = 3
    float drive:angular:physics:targetPosition = 30
}
def PhysicsJoint "b" (prepend apiSchemas = ["PhysicsLimitAPI:transX", "PhysicsLimitAPI:rotX"])
{
    rel physics:body0 = </crank>
    rel physics:body1 = </rod>
    float limit:transX:physics:low = 1
    float limit:transX:physics:high = -1
    float limit:rotX:physics:low = 1
    float limit:rotX:physics:high = -1
}
"""


class Harness:
    SUFFIX = '.xml'

    def __init__(self) -> None:
        self._folder = scratch('robots')

    def make(self, random: Random) -> bytes:
        """A robot file."""
        if random.randrange(4) == 0:
            return self._stage(random)
        root = ElementTree.fromstring(random.choice((URDF, URDF, MJCF)))
        for _ in range(random.choice((1, 1, 2, 3))):
            self._change(root, random)
        data = ElementTree.tostring(root, 'unicode').encode('utf-8', 'replace')
        return damaged(data, random) if random.randrange(8) == 0 else data

    def _stage(self, random: Random) -> bytes:
        """A USD text with some of its words and lines changed."""
        text = USD
        for _ in range(random.choice((1, 1, 2, 3))):
            lines = text.split('\n')
            place, kind = random.randrange(1, len(lines)), random.randrange(6)
            if kind == 0:
                del lines[place]
            elif kind == 1:
                lines.insert(random.randrange(1, len(lines)), lines[place])
            text = '\n'.join(lines)
            words = list(re.finditer(r'-?\d[\d.]*' if kind < 4 else r'[\w:]+', text[10:]))
            word, other = random.choice(words), random.choice(words)
            some = str(number(random)) if kind < 4 else other[0]
            text = text[: 10 + word.start()] + some + text[10 + word.end() :]
        return text.encode('utf-8', 'replace')

    def _change(self, root: ElementTree.Element, random: Random) -> None:
        parents = [each for each in root.iter() if len(each)]
        elements = list(root.iter())
        element, kind = random.choice(elements), random.randrange(6)
        keys = sorted(element.attrib)
        if kind <= 2 and keys:
            key = random.choice(keys)
            words = element.attrib[key].split() or ['']
            some = [str(number(random)), *(t for t in TEXTS if t.isprintable())]
            some += [random.choice(sorted(random.choice(elements).attrib.values()) or [''])]
            words[random.randrange(len(words))] = random.choice(some)
            element.attrib[key] = ' '.join(words[: random.choice((1, 3, 9))])
        elif kind == 3 and keys:
            del element.attrib[random.choice(keys)]
        elif parents:
            parent = random.choice(parents)
            child = random.choice(list(parent))
            if kind == 4:
                parent.remove(child)
            else:
                other = random.choice(parents)
                if child not in other.iter() and other not in child.iter():
                    other.append(child)

    def check(self, case: bytes) -> str:
        """A mechanism that loads, or one line."""
        from alf_ros.errors import AlfError
        from alf_ros.exchange.import_file import imported

        name = 'robot.xml' if b'<mujoco' in case else 'robot.urdf'
        path = self._folder / ('robot.usda' if case.startswith(b'#usda') else name)
        path.write_bytes(case)
        try:
            imported(str(path), stops=1e3)
        except AlfError as error:
            assert str(error).isprintable() and len(str(error)) < 900, f'no clear line {error}'
            return 'refused'
        return 'ran'
