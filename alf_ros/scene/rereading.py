"""A scene read again where its entries have changed, and only there.

The members of a study, and the candidates of a search, are scenes of which a few numbers differ.
`overrides` shares all other entries with the first one, so their identity shows the changes.
Numbers of bodies, effects, velocities and settings are read again by themselves, by the
readers of whole scenes; if anything else has changed, all of the scene is.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from functools import cached_property, partial

import numpy as np

from alf_ros.mechanism import Body, Mechanism
from alf_ros.mechanism.natural_coordinates import Layout, cut
from alf_ros.scene.effects_section import fit, read_effects, with_rotors
from alf_ros.scene.mechanism_file import read_parameters
from alf_ros.scene.mechanism_file.bodies import BodyReader
from alf_ros.scene.mechanism_file.shapes_section import ShapeReader
from alf_ros.scene.references import References
from alf_ros.scene.scene import KEYS, Scene, Solver, load_scene, read_initial, read_solver
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.scene.text.yaml_document import Entry

_SECTIONS = frozenset(('mechanism', 'effects', 'initial', 'solver'))
_MASSES = frozenset(('mass', 'com', 'inertia'))
_NOTHING = Entry({})


class ReadDocument:
    """A document that was read: its entries, with their meaning."""

    def __init__(self, document: SceneDocument) -> None:
        self.root = document.root
        self.places: dict[str, tuple[str, ...]] = {}  # of names of its values
        self._fields = self.root.mapping()
        self._settings: tuple[object, Solver | None] = (), None
        self._asked = False

    @cached_property
    def _scene(self) -> Scene:
        return load_scene(self._fields)

    @cached_property
    def _bare(self) -> Mechanism:
        """The mechanism without the rotors of effects."""
        scene = self._scene
        if not scene.mechanism.rotors:
            return scene.mechanism
        return dataclasses.replace(scene.mechanism, rotors=())

    @cached_property
    def _cut(self) -> Layout:
        return cut(self._bare)

    @cached_property
    def _values(self) -> dict[str, float]:
        return read_parameters(self._fields['mechanism'].mapping().get('parameters'), {})

    @cached_property
    def _bodies(self) -> BodyReader:
        dimension = self._bare.dimension
        return BodyReader({}, {}, dimension, ShapeReader(dimension, References()))

    def again(self, root: Entry, file: str | None) -> Scene | None:
        """The scene of other entries, from a file; None if they differ in more than numbers that
        are read by themselves, and for the first one: most documents are changed once. Raises
        InputError as the reader of a whole scene does."""
        if not self._asked:
            self._asked = True
            return None
        fields, scene = root.mapping(), self._scene
        changed = {key for key, entry in fields.items() if entry is not self._fields.get(key)}
        if not changed <= _SECTIONS or fields.keys() != self._fields.keys():
            return None
        given = scene.positions, scene.velocities, scene.branch
        layout, effects = self._cut, scene.effects
        if 'mechanism' in changed:
            bodies = self._other_bodies(fields['mechanism'])
            if bodies is None:
                return None
            layout = dataclasses.replace(layout, mechanism=self._bare.with_bodies(bodies))
        if 'initial' in changed:
            given = read_initial(fields['initial'], layout.mechanism, self._values)
        positions, velocities, branch = given
        solver = self._solver(fields['solver']) if 'solver' in changed else scene.solver
        section = fields.get('effects', _NOTHING)
        if 'effects' in changed:
            effects, section = read_effects(section, layout, self._values, References())
        elif not fit(effects, layout):
            return None
        return dataclasses.replace(
            scene,
            mechanism=with_rotors(layout.mechanism, effects),
            effects=effects,
            positions=positions,
            velocities=velocities,
            branch=branch,
            solver=solver,
            document=SceneDocument(partial(_whole, fields, section, solver)),
            file=file,
            says_solver=True,
        )

    def _solver(self, section: Entry) -> Solver:
        """The settings, which many scenes share."""
        said = tuple((k, e.value, e.plain) for k, e in section.mapping().items())
        before, known = self._settings
        if known is None or said != before:
            known = read_solver(section, self._values)
            self._settings = said, known
        return known

    def _other_bodies(self, mechanism: Entry) -> tuple[Body, ...] | None:
        """The bodies with the masses in the section of a mechanism; None if it differs in more."""
        before, fields = self._fields['mechanism'].mapping(), mechanism.mapping()
        changed = [key for key, entry in fields.items() if entry is not before.get(key)]
        if changed != ['bodies'] or fields.keys() != before.keys():
            return None
        old, new = before['bodies'].mapping(), fields['bodies'].mapping()
        if old.keys() != new.keys():
            return None
        found = dict(self._bare.body)
        for name, entry in new.items():
            if entry is not old[name]:
                body = self._other_body(name, old[name], entry)
                if body is None:
                    return None
                found[name] = body
        return tuple(found.values())

    def _other_body(self, name: str, old: Entry, new: Entry) -> Body | None:
        """A body with other masses; None if more than these differ, or if its orientation would
        be carried otherwise."""
        before, fields = old.mapping(), new.mapping()
        changed = {key for key in (*before, *fields) if before.get(key) is not fields.get(key)}
        if not changed <= _MASSES or name not in self._bare.body or 'for' in fields:
            return None
        body, item = self._bare.body[name], Item(name, new, fields, self._values)
        oriented = 'vectors' in fields and bool(fields['vectors'].sequence())
        mass, com, inertia = self._bodies.masses(item, body.local, oriented)
        other = dataclasses.replace(body, mass=mass, com=com, inertia=inertia)
        if self._bare.dimension == 3 and _along(other) != _along(body):
            return None
        return other


def _along(body: Body) -> tuple[bool, bool]:
    """Whether it has inertia about the axis of its points, and mass beside it."""
    return bool(np.any(np.array(body.inertia)[0])), bool(np.any(np.array(body.com)[1:]))


def _whole(fields: Mapping[str, Entry], effects: Entry, solver: Solver) -> Mapping[str, object]:
    """The fields of the document of a scene that was read again."""
    found: dict[str, object] = {**fields, 'solver': solver.settings}
    if 'effects' in found:
        found['effects'] = effects
    return {key: found[key] for key in KEYS if key in found}


def reading_of(document: SceneDocument) -> ReadDocument:
    """The reading of a document, kept as long as the document is."""
    known = document.reading
    if not isinstance(known, ReadDocument):
        known = document.reading = ReadDocument(document)
    return known
