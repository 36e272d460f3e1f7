"""A scene read again where its entries have changed, and only there.

The members of a study, and the candidates of a search, are scenes of which a few numbers differ.
`overrides` shares all other entries with the first one, so their identity shows the changes.
Parameters, parts of the mechanism, masses, effects, velocities and settings are read again by
themselves, by the readers of whole scenes, and only where numbers that they name have changed. If
anything else has, or if the mechanism becomes another one in more than numbers, all of the scene
is read again.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from functools import cached_property, partial

import numpy as np

from alf_ros.effects import Effect
from alf_ros.mechanism import Body, Mechanism
from alf_ros.mechanism.natural_coordinates import Layout, cut
from alf_ros.scene.effects_section import effect_entries, fit, read_effects, with_rotors
from alf_ros.scene.mechanism_file import read_parameters, read_parts
from alf_ros.scene.mechanism_file.bodies import BodyReader
from alf_ros.scene.mechanism_file.shapes_section import ShapeReader
from alf_ros.scene.mechanism_file.topology_check import check_numbers
from alf_ros.scene.references import References
from alf_ros.scene.scene import KEYS, Scene, Solver, load_scene, read_initial, read_solver
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.scene_document import SceneDocument
from alf_ros.scene.text.yaml_document import Entry

_SECTIONS = frozenset(('mechanism', 'effects', 'initial', 'solver'))
_PARTS = frozenset(('parameters', 'points', 'vectors', 'bodies', 'joints'))
_NAMING = ('effects', 'initial', 'solver')  # sections whose numbers may name parameters
_MASSES = frozenset(('mass', 'com', 'inertia'))
_NOTHING = Entry({})
_WORD = re.compile(r'[A-Za-z_][A-Za-z0-9_]*')


class ReadDocument:
    """A document that was read: its entries, with their meaning."""

    def __init__(self, document: SceneDocument) -> None:
        self.root = document.root
        self.places: dict[str, tuple[str, ...]] = {}  # of names of its values
        self._fields = self.root.mapping()
        self._settings: tuple[object, Solver | None] = (), None  # the last ones
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

    def _naming(self, values: dict[str, float]) -> set[str]:
        """The sections that name a parameter whose value is another one."""
        if values is self._values:
            return set()
        known = self._values
        others = {name for name, value in values.items() if repr(value) != repr(known[name])}
        return {key for key in _NAMING if others & self._words[key]}

    @cached_property
    def _words(self) -> dict[str, set[str]]:
        """The words in each section whose numbers may name parameters."""
        found: dict[str, set[str]] = {}
        for key in _NAMING:
            found[key] = set()
            _collect(self._fields.get(key, _NOTHING), found[key])
        return found

    @cached_property
    def _known_effects(self) -> list[tuple[Entry, Effect]]:
        """Each effect with its entry."""
        entries = effect_entries(self._fields.get('effects', _NOTHING))
        return list(zip(entries, self._scene.effects, strict=True))

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
        layout, effects, values = self._cut, scene.effects, self._values
        if 'mechanism' in changed:
            found = self._other_mechanism(fields['mechanism'])
            if found is None:
                return None
            layout, values = found
            changed |= self._naming(values)
        if 'initial' in changed:
            given = read_initial(fields['initial'], layout.mechanism, values)
        positions, velocities, branch = given
        solver = self._solver(fields['solver'], values) if 'solver' in changed else scene.solver
        section = fields.get('effects', _NOTHING)
        if 'effects' in changed:
            known = self._known_effects if layout is self._cut and values is self._values else []
            effects, section = read_effects(section, layout, values, References(), known)
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

    def _solver(self, section: Entry, values: Mapping[str, float]) -> Solver:
        """The settings, which many scenes share."""
        said: tuple[object, ...] = tuple(
            (k, e.value, e.plain) for k, e in section.mapping().items()
        )
        if values is not self._values:
            words = set[str]()
            _collect(section, words)
            said += tuple((name, values[name]) for name in values if name in words)
        before, known = self._settings
        if known is None or said != before:
            known = read_solver(section, values)
            self._settings = said, known
        return known

    def _other_mechanism(self, section: Entry) -> tuple[Layout, dict[str, float]] | None:
        """The mechanism, cut, of a section with other numbers, and its parameters; None if it
        differs in more, or in numbers that other parts of the scene were read with."""
        before, fields = self._fields['mechanism'].mapping(), section.mapping()
        changed = {key for key, entry in fields.items() if entry is not before.get(key)}
        if not changed <= _PARTS or fields.keys() != before.keys():
            return None
        if changed == {'bodies'}:
            bodies = self._other_bodies(before['bodies'], fields['bodies'])
            if bodies is not None:
                mechanism = self._bare.with_bodies(bodies)
                return dataclasses.replace(self._cut, mechanism=mechanism), self._values
        return self._other_geometry(fields)

    def _other_geometry(
        self, fields: Mapping[str, Entry]
    ) -> tuple[Layout, dict[str, float]] | None:
        """The same of all fields of the mechanism."""
        scene, bare = self._scene, self._bare
        if bare.drives or bare.couplings or scene.sensors or scene.diff_drive is not None:
            return None
        shown = (bare.shapes, *(body.shapes for body in bare.bodies))
        if any(shape.kind == 'mesh' for shapes in shown for shape in shapes):
            return None  # their files are named relative to others
        values = read_parameters(fields.get('parameters'), {})
        shapes = ShapeReader(bare.dimension, References())
        mechanism, parts = read_parts(fields, bare.name, values, bare.dimension, shapes)
        if mechanism.structure != bare.structure or values.keys() != self._values.keys():
            return None
        layout = self._cut.like(mechanism)
        check_numbers(layout, self._cut, parts.entries)
        return layout, values

    def _other_bodies(self, before: Entry, now: Entry) -> tuple[Body, ...] | None:
        """The bodies with the masses in a section; None if it differs in more."""
        old, new = before.mapping(), now.mapping()
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


def _collect(entry: Entry, words: set[str]) -> None:
    """Add the words in all scalars of an entry."""
    value = entry.value
    if isinstance(value, str):
        words.update(_WORD.findall(value))
        return
    for item in value.values() if isinstance(value, dict) else value:
        _collect(item, words)


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
