"""Random trees of bodies, as SDF of any version with frames of all kinds, and as plain MJCF.

The world poses of all frames are drawn first. The SDF then states each of them relative to a frame
that is chosen at random, so that a reader has to find the same world poses again.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from alf_ros.arrays import Floats
from alf_ros.exchange.robot import FramePose

SCOPES = ('', 'n1::', 'n1::n2::', 'k::')  # of the models, the root first
MODEL = '__model__'
ALIKE = {'continuous': 'revolute', 'revolute2': 'universal', 'Revolute': 'revolute'}
AXES = {'ball': 0, 'fixed': 0, 'universal': 2}  # 1 for others
KINDS = ('revolute', 'prismatic', 'ball', 'universal', 'fixed', *ALIKE)
LINKS, FRAMES, REACH = 7, 4, 0.4  # m
INERTIA = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
DEFAULT = 1.0, np.zeros(3), Rotation.identity(), np.ones(3)  # of a link without <inertial>


def text(values: Sequence[float] | Floats) -> str:
    return ' '.join(repr(float(x)) for x in values)


class RandomTree:
    """Links with joints to others before them, or to the world. All names are scoped.

    old: written without the keys that versions after 1.6 have.
    """

    def __init__(self, seed: int, version: str, folder: Path) -> None:
        self.random, self.version, self.folder = np.random.default_rng(seed), version, folder
        self.old = version in ('1.4', '1.5', '1.6')
        self.poses = {f'{scope}{MODEL}': self._pose() for scope in SCOPES}
        self.links: list[str] = []
        self.parent: dict[str, str] = {}
        self.joint: dict[str, str] = {}
        self.kind: dict[str, str] = {}
        self.axes: dict[str, Floats] = {}
        self.attached: dict[str, str] = {}  # the link of a frame
        self.named: dict[str, str] = {}  # what a frame names: its link, or a frame before it
        self.inertia: dict[str, tuple[float, Floats, Rotation, Floats]] = {}
        for n in range(LINKS):
            scope = SCOPES[n] if n < len(SCOPES) else self._one(SCOPES)  # each has a link
            self._add_link(n, f'{scope}l{n}')
        for n in range(0 if self.old else FRAMES):
            scope = self._one(SCOPES)
            own = [link for link in self.links if link.startswith(scope)]
            name = f'{scope}f{n}'
            self.poses[name], link = self._pose(), self._one(own)
            self.named[name] = self._one([link, *self._fixed_to(link, scope)])
            self.attached[name] = link

    def _one(self, choices: Sequence[str]) -> str:
        return choices[int(self.random.integers(len(choices)))]

    def _happens(self, share: float) -> bool:
        return bool(self.random.random() < share)

    def _turn(self) -> Rotation:
        return Rotation.from_quat(self.random.standard_normal(4))

    def _pose(self) -> FramePose:
        return FramePose(self.random.uniform(-REACH, REACH, 3), self._turn().as_matrix())

    def _add_link(self, n: int, link: str) -> None:
        parent = 'world' if n == 0 or self._happens(0.15) else self._one(self.links)
        shared = [s for s in SCOPES if link.startswith(s) and (parent + '::').startswith(s)]
        joint = f'{self._one(shared) if parent != "world" else ""}j{n}'
        first = self.random.standard_normal(3)
        second = np.cross(first, self.random.standard_normal(3))
        self.links.append(link)
        self.poses[link], self.poses[joint] = self._pose(), self._pose()
        self.parent[link], self.joint[link] = parent, joint
        self.kind[link] = self._one(KINDS[:2] if n == 0 else KINDS)
        self.axes[link] = np.array([u / np.linalg.norm(u) for u in (first, second)])
        s = self.random.uniform(0.02, 0.1, 3)
        moments = np.array([s[1] + s[2], s[2] + s[0], s[0] + s[1]])
        mass, com = float(self.random.uniform(0.5, 2.0)), self.random.uniform(-0.2, 0.2, 3)
        given = mass, com, self._turn(), moments
        self.inertia[link] = DEFAULT if self._happens(0.1) else given

    # ---------------------------------------------------------------------------------------- SDF

    def sdf(self) -> str:
        """The file; models that are included lie beside it."""
        pose = self._values(self.poses[MODEL])
        return self._whole(f'<model name="m">{pose}{self._content("")}</model>')

    def _whole(self, model: str) -> str:
        return f'<sdf version="{self.version}">{model}</sdf>'

    def _content(self, scope: str) -> str:
        links = [self._link(link, scope) for link in self.links if _scope(link) == scope]
        others = [self._frame(each, scope) for each in self.attached if _scope(each) == scope]
        others += [self._joint(k, j, scope) for k, j in self.joint.items() if _scope(j) == scope]
        others += [self._nested(s, scope) for s in SCOPES[1:] if _scope(s[:-2]) == scope]
        self.random.shuffle(others)  # the first link is the canonical one
        return ''.join([*links, *others])

    def _visible(self, scope: str, kinds: str) -> list[str]:
        """Frames that can be named in a scope: links, joints, frames, of nested models too."""
        named = [each for each in self.poses if each.startswith(scope) and MODEL not in each]
        return [each for each in named if each.rpartition('::')[2][0] in kinds]

    def _stated(self, pose: FramePose, scope: str, default: str, kinds: str) -> str:
        """A <pose>, relative to the default or to another frame, of which nothing leads back."""
        choices = [each for each in self._visible(scope, kinds) if each != default]
        if self.old or not choices or self._happens(0.4):
            return self._values(self.poses[default].inverse @ pose)
        other = self._one(choices)
        return self._values(self.poses[other].inverse @ pose, other.removeprefix(scope))

    def _values(self, pose: FramePose, relative_to: str = '') -> str:
        turn = Rotation.from_matrix(pose.turn)
        ways = {
            '': turn.as_euler('xyz'),
            ' degrees="true"': turn.as_euler('xyz', degrees=True),
            ' rotation_format="quat_xyzw"': turn.as_quat(),
        }
        how = '' if self.old else self._one(list(ways))
        to = f' relative_to="{relative_to}"' if relative_to else ''
        return f'<pose{to}{how}>{text([*pose.origin, *ways[how]])}</pose>'

    def _link(self, link: str, scope: str) -> str:
        pose = self._values(self.poses[f'{scope}{MODEL}'].inverse @ self.poses[link])
        return f'<link name="{link.removeprefix(scope)}">{pose}{self._inertial(link)}</link>'

    def _inertial(self, link: str) -> str:
        """In the principal axes, or in axes that are turned: with products of inertia."""
        mass, com, principal, moments = self.inertia[link]
        if self.inertia[link] is DEFAULT and self._happens(0.5):
            return ''
        turn = self._turn() if self._happens(0.5) else principal
        A = (turn.inv() * principal).as_matrix()
        J = A @ np.diag(moments) @ A.T
        rows = zip(*np.triu_indices(3), strict=True)
        inertia = ''.join(
            f'<{key}>{float(J[row])!r}</{key}>' for key, row in zip(INERTIA, rows, strict=True)
        )
        own = self._values(FramePose(com, turn.as_matrix()))
        return f'<inertial>{own}<mass>{mass!r}</mass><inertia>{inertia}</inertia></inertial>'

    def _fixed_to(self, link: str, scope: str) -> list[str]:
        """Frames of a link that can be named in a scope."""
        return [each for each in self._visible(scope, 'f') if self.attached.get(each) == link]

    def _frame(self, frame: str, scope: str) -> str:
        at = self.named[frame]
        pose = self._stated(self.poses[frame], scope, at, 'l')
        name = frame.removeprefix(scope)
        return f'<frame name="{name}" attached_to="{at.removeprefix(scope)}">{pose}</frame>'

    def _joint(self, link: str, joint: str, scope: str) -> str:
        child = self._one([link, *self._fixed_to(link, scope)])
        parent = self._one([self.parent[link], *self._fixed_to(self.parent[link], scope)])
        pairs = list(zip(('axis', 'axis2'), self.axes[link], strict=True))
        given = pairs[: AXES.get(self._kind(link), 1)]
        axes = ''.join(self._axis(tag, axis, joint, scope) for tag, axis in given)
        return (
            f'<joint name="{joint.removeprefix(scope)}" type="{self.kind[link]}">'
            f'{self._stated(self.poses[joint], scope, child, "lf")}'
            f'<parent>{parent.removeprefix(scope)}</parent>'
            f'<child>{child.removeprefix(scope)}</child>{axes}</joint>'
        )

    def _axis(self, tag: str, axis: Floats, joint: str, scope: str) -> str:
        frame, given, flag = joint, '', ''
        if self.old:
            of_model = self._happens(0.5)
            flag = f'<use_parent_model_frame>{str(of_model).lower()}</use_parent_model_frame>'
            if of_model == (self.version == '1.4') and self._happens(0.5):
                flag = ''  # as it is without a word
            frame = f'{scope}{MODEL}' if of_model else joint
        elif self._happens(0.6):
            frame = self._one([f'{scope}{MODEL}', *self._visible(scope, 'lfj')])
            given = f' expressed_in="{frame.removeprefix(scope)}"'
        inner = self.poses[frame].turn.T @ axis * self.random.uniform(0.5, 2.0)
        return f'<{tag}><xyz{given}>{text(inner)}</xyz>{flag}</{tag}>'

    def _nested(self, own: str, scope: str) -> str:
        """A model within another: written there, or included; placed by a frame within it."""
        name, frame = own.removeprefix(scope)[:-2], f'{own}{MODEL}'
        placed = '' if self.old or self._happens(0.5) else self._one(self._visible(own, 'lf'))
        outer = self._visible(scope, 'l')
        outer = [each for each in outer if _scope(each) == scope]  # which hang from no nested one
        pose, to = self.poses[placed or frame], f'{scope}{MODEL}'
        if not self.old and self._happens(0.5):
            to = self._one(outer)
        stated = self._values(
            self.poses[to].inverse @ pose, '' if MODEL in to else to.removeprefix(scope)
        )
        content, inner = self._content(own), placed.removeprefix(own)
        if self._happens(0.5):
            (self.folder / name).mkdir(exist_ok=True)
            model = self._whole(f'<model name="other">{content}</model>')
            (self.folder / name / 'model.sdf').write_text(model, encoding='utf-8')
            by = f'<placement_frame>{inner}</placement_frame>' if placed else ''
            return f'<include><uri>model://{name}</uri><name>{name}</name>{stated}{by}</include>'
        by = f' placement_frame="{inner}"' if placed else ''
        return f'<model name="{name}"{by}>{stated}{content}</model>'

    # --------------------------------------------------------------------------------------- MJCF

    def mjcf(self, option: str) -> str:
        """The same tree; joints are at places and along axes of their links."""
        bodies = ''.join(self._body(link) for link in self.links if self.parent[link] == 'world')
        return (
            f'<mujoco><option {option}/><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
            '</mujoco>'
        )

    def _body(self, link: str) -> str:
        parent, own = self.parent[link], self.poses[link]
        pose = own if parent == 'world' else self.poses[parent].inverse @ own
        mass, com, turn, moments = self.inertia[link]
        A = turn.as_matrix()
        J = A @ np.diag(moments) @ A.T
        full = [J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2]]
        inner = ''.join(self._body(each) for each in self.links if self.parent[each] == link)
        return (
            f'<body name="{link}" pos="{text(pose.origin)}" quat="{_quaternion(pose.turn)}">'
            f'{"".join(self._hinges(link))}<inertial pos="{text(com)}" mass="{mass!r}" '
            f'fullinertia="{text(full)}"/>{inner}</body>'
        )

    def _hinges(self, link: str) -> Iterator[str]:
        kind = self._kind(link)
        at = text(self.poses[link].inverse.place(self.poses[self.joint[link]].origin))
        axes = [text(self.poses[link].turn.T @ axis) for axis in self.axes[link]]
        if kind == 'ball':
            yield f'<joint type="ball" pos="{at}"/>'
        elif kind != 'fixed':
            slides = 'slide' if kind == 'prismatic' else 'hinge'
            for axis in axes[: AXES.get(kind, 1)]:
                yield f'<joint type="{slides}" pos="{at}" axis="{axis}"/>'

    def _kind(self, link: str) -> str:
        """The type of its joint, by one name for those that are alike."""
        return ALIKE.get(self.kind[link], self.kind[link])


def _scope(name: str) -> str:
    """Of the model in which a name is given."""
    return name[: name.rfind('::') + 2] if '::' in name else ''


def _quaternion(turn: Floats) -> str:
    return text(np.roll(Rotation.from_matrix(turn).as_quat(), 1))
