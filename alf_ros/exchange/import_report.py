"""Parts of a file that are not imported, and the consequences for the motion.

Every kind of loss is named here once, with its consequence: the head of a file that `import`
writes begins with the losses that change the motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

# what changes the motion, and how
MOTION = {
    'loops (see --loops)': 'they are open: the file that closes them is not given',
    'masses, given': 'the file has none: forces, and motions under forces, are not those of the '
    'robot',
    'inertia, repaired': 'the least change that makes it one of a body',
    'inertia: there is none': 'all mass is at the centre of mass',
    'joints of massless ends': 'they and their links do not move, because they carry no mass',
    'joints without inertia': 'all mass that turns is on their axis, so they are fixed as drawn',
    'no mass in a free direction': 'a run stops: give these bodies mass and inertia, make one of '
    'the joints `fixed`, or give one a rotor (`armature` of a motor)',
    'angles of balls': 'a ball is in place of the joints: their angles are not published, because '
    'a part at its ends has no inertia about an axis',
    'joints near gimbal lock': 'links without mass turn fast there, and stop a run',
    'rows of joints with skew axes': 'where their axes lie in one plane they stop a run: '
    'the links between have no mass',
    'rows of joints for balls': 'at gimbal lock they stop a run',
    'products of inertia: there is none': 'they count as 0',
    'inertia by shapes': 'it is not computed: the one in the file counts',
    'mass: default of SDF': 'a link without a mass has 1 kg and 1 kg m2 about every axis',
    'gravity (see --scene)': 'gravity is absent',
    'velocities of bodies (see --scene)': 'the motion starts at rest',
    'velocities of bodies': 'the joints do not permit them: the motion starts at rest',
    'velocities of many bodies': 'the mechanism is too large to fit them to its joints: the '
    'motion starts at rest',
    'compensation of gravity': 'these bodies have their whole weight here',
    'compensation of gravity (see --scene)': 'these bodies have their whole weight',
    'mass of disabled shapes': 'shapes whose collision is disabled have no mass, as the '
    'specification of OpenUSD 26.11 says',
    'inertia: default of USD': 'a body with a mass and without shapes has that of a ball of 0.1 m',
    'shapes without their file': 'their mass is not counted',
    'contact': 'bodies pass through each other and through the ground (see --ground)',
    'contact with the ground (see --contact)': 'bodies pass through the ground: a robot that '
    'nothing else holds falls',
    'contact in USD': 'bodies pass through each other and through the ground',
    'contact of other shapes': 'these pass through the ground',
    'contact between bodies': 'they pass through each other',
    'contact with fixed shapes': 'bodies pass through these: of what does not move only planes '
    'hold something',
    'contact as drawn': 'these are drawn in the ground, which pushes them out at the start',
    'adhesion and moving surfaces': 'these neither stick to the ground nor carry along',
    'law of contact': 'its stiffness is that of --contact; no impact leaves the ground faster '
    'than 0.1 m/s',
    'filters of contact': 'these meet the ground whatever their bitmask',
    'friction in two directions': 'the smallest coefficient acts in all directions',
    'second pairs of contact': 'the first pair of two geoms acts alone',
    'slip of contact': 'these do not slip further the harder they are pushed along the ground',
    'friction of Bullet': 'the coefficients of ODE count, which are 1 where the file has none',
    'friction of contact': 'bodies spin and roll on the ground without resistance',
    'damping (see --scene)': 'joints are not damped',
    'springs (see --scene)': 'joints have no springs',
    'dry friction (see --scene)': 'joints have no friction',
    'law of dry friction': 'it fades below 0.01 rad/s or m/s: what it holds creeps slowly',
    'higher orders of damping': 'it is linear in the speed: the coefficients of square and cube '
    'are left out',
    'springs that yield': 'they do not yield here, however far they are bent',
    'higher orders of springs': 'they are linear in the deflection: the coefficients of square '
    'and cube are left out',
    'armature (see --scene)': 'the inertia of rotors is not counted',
    'damping of bodies': 'these bodies are not damped',
    'gyroscopic moments off': 'these bodies have them here',
    'locked axes of bodies': 'these bodies move along and about all axes',
    'shells': 'these shapes have the mass of solids',
    'masses that MuJoCo changes': 'they are those of the bodies in the file',
    'positions of joints': 'the bodies start as drawn, not there',
    'velocities of joints': 'the motion starts with the velocities of the bodies only',
    'velocities that are clamped': 'here nothing stops at the limits of velocity',
    'springs by time constants': 'these joints have neither the spring nor the damper',
    'attributes that disagree': 'the first one counts',
    'values at times': 'each counts as it is without a time, or as if the file had none',
    'several scenes': 'all bodies have the gravity and the switches of the first one',
    'instances of points': 'these bodies are there once, where they are described',
    'attributes without a counterpart': 'what they do is missing',
    'soft limits': 'they do not give way as in the file: with --stops they have its stiffness',
    'margins of limits': 'limits act at their values',
    'friction coefficients of PhysX': 'these joints have no friction: the file has no load',
    'breaking of joints': 'these joints carry any load',
    'distances with play': 'these joints hold nothing: a minimum and a maximum differ',
    'swings of two axes': 'universal joints: with both angles large they turn otherwise',
    'limits (see --stops)': 'joints pass their limits',
    'limits of screws': 'of angles or of lengths, as simulators differ: nothing stops them here',
    'pitch of screws: default of SDF': 'a screw without a pitch advances 1 m in a turn',
    'limits as drawn': 'these are drawn beyond a limit, and its stop throws them back at the '
    'start',
    'limits of mimics': 'they contradict those of the joints that are mimicked: loops were closed '
    'beyond them',
    'limits: there are none': 'the format asks for some: these joints move without end',
    'limits without range': 'lower is not below upper: nothing stops them',
    'limits, damping, friction, springs, armature': 'these joints have none',
    'damping of balls': 'between two moving bodies, or of one that turns without inertia: these '
    'balls turn without it, and the motion keeps the energy that it takes',
    'mimic': 'these joints are free',
    'mimic that loops imply': 'the loops move these joints',
    'phase of mimic': 'it stays as drawn, not as in the file',
    'equalities': 'not joint, tendon over joints, connect or weld, or not linear: they are '
    'ignored',
    'softness': 'constraints hold exactly',
    'actuators (see --scene)': 'they apply no force',
    'actuators': 'they apply no force',
    'gains of actuators': 'the file has none: a motor without gains applies no force by itself',
    'reductions of transmissions': 'a command is the effort of the joint, not that of a motor '
    'before the reduction',
    'rotors of transmissions': 'the inertia of rotors is not counted: give it as `armature` of '
    'the motor, times the square of the reduction',
    'constants of motors': 'a command is the effort of the joint, not a current',
    'limits of commands': 'commands beyond them act too',
    'limits of motors': 'they bound no effort that is sent to the joint: such efforts act beyond '
    'them too',
    'ranges of controls': 'they bound the control at the start only: targets that are sent later '
    'act beyond them too',
    'activation of actuators': 'they act without delay',
    'integrators of actuators': 'they integrate no control: they stay as at the start',
    'force ranges of joints': 'they are of a sum: here of each actuator on the joint or tendon, '
    'and of none on a tendon that moves the joint',
    'force ranges of actuators': 'different in the two directions: the larger one is used',
    'tendons (see --scene)': 'they apply no force',
    'tendons': 'they apply no force',
    'higher orders of tendons': 'their springs and dampers are linear',
    'armature of tendons': 'over places: the inertia of their drives is not counted',
    'armature on branches': 'the rotors of these tendons couple all of their joints; MuJoCo '
    'leaves out what couples joints that do not hang from each other',
    'motion of mocap bodies': 'they do not move',
    'motion of kinematic bodies': 'they do not move',
    'sleeping bodies': 'they move from the start, not when something touches them',
    'flex': 'deformable bodies are omitted',
    'fluid': 'the air has no density, no viscosity, no wind',
    'added mass of fluids': 'these bodies move without it',
    'plugins': 'forces and control that they apply are missing',
    'state of the world': 'models start where they are placed',
    'wind': 'it exerts no force on these bodies',
    'unknown attributes': 'the format has no such attribute there: what it does to the motion is '
    'missing',
    'unknown elements': 'the format has no such element there, or only one: what they do to '
    'the motion is missing',
    'unknown text': 'the format has no text there: what it does to the motion is missing',
    'physics of Gazebo': 'what these extensions do to the motion is missing',
    'several root links': 'each is fixed to the ground as drawn (see --floating)',
    'joints of unknown type': 'they are omitted',
    'gearboxes': 'they are omitted: their links are not on hinges of a reference body about '
    'their axes',
    'includes': 'their content is omitted',
    'parameters of includes': 'the models are as in their own files',
    'version of SDF': '1.4 to 1.12 are expected: read as the nearest of them',
}
_COUNTED = (
    'contact',
    'contact in USD',
    'contact with the ground (see --contact)',
    'contact between bodies',
)  # names give no information here
# what reads differently, but moves alike
READING = {
    'names, changed': '',
    'rows of joints that are balls': 'they keep names and angles; no force acts on one of them '
    '(see --no-balls)',
    'mass: there is none': 'these move with the bodies between which they are, as in a universal '
    'joint',
    'masses of the file': 'they count, and none is given',
    'zero of joints': 'here it is as drawn',
    'link of the world: there is none': 'it is the ground, as in Drake',
    'posture': "the loops of the file are open as drawn; Newton's method moved the joints",
    'qpos of bodies': 'loops are closed with free bodies and balls there, as in a keyframe',
    'posture of bodies': 'joints are open as drawn; the bodies were moved to close them',
    'switched off in the file': 'not imported',
    'warnings of MuJoCo': '',
    'elements': '',
    'gazebo': '',
    'actuators in one': 'one motor stands for all on the joint, because its range is that of the '
    'sum',
    'limits of velocity': '',
    'limits of effort': '',
    'calibration': '',
    'safety_controller': '',
}
# what only looks otherwise
LOOKS = {
    'meshes far larger than the robot': 'their files may be in millimetres, and then need a scale '
    'of 0.001',
}
# what moves nothing, counted only
NOTHING = ('shapes', 'lights', 'cameras', 'sensors', 'keyframes', 'materials')


class LeftOut:
    """Names of the omitted parts, by kind."""

    def __init__(self) -> None:
        self.names: dict[str, list[str]] = {}

    def add(self, kind: str, name: str) -> None:
        """Note that something of `name` does not come along."""
        assert any(kind in each for each in (MOTION, READING, LOOKS, NOTHING)), kind
        names = self.names.setdefault(kind, [])
        if name not in names:
            names.append(name)

    def remove(self, kind: str, name: str) -> None:
        """Take back what `add` noted."""
        names = self.names.get(kind, [])
        if name in names:
            names.remove(name)
        if not names:
            self.names.pop(kind, None)

    def lines(self) -> Iterator[str]:
        """The report: first omissions that change the motion, at the end the others in one
        line."""
        for head, kinds in (
            ('Changes of the motion:', MOTION),
            ('Changes of readings only:', READING),
            ('Hints for the shapes:', LOOKS),
        ):
            found = [_line(kind, kinds[kind], self.names[kind]) for kind in self._of(kinds)]
            if found:
                yield head
                yield from (f'  {line}' for line in found)
        counts = [f'{kind} {len(self.names[kind])}' for kind in self._of(NOTHING)]
        if counts:
            yield f'Left out without an effect on the motion: {", ".join(counts)}'

    def _of(self, kinds: Mapping[str, str] | Sequence[str]) -> list[str]:
        return [kind for kind in kinds if kind in self.names]


def _line(kind: str, consequence: str, names: Sequence[str]) -> str:
    if kind in _COUNTED:
        return f'{kind}: {consequence} ({len(names)})'
    return ': '.join(part for part in (kind, consequence, ', '.join(names)) if part)
