"""The `couplings` of a mechanism file: `{joints: {a: 1, b: -2}}`, of which the sum stays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from alf_ros.mechanism import Coupling, Mechanism
from alf_ros.mechanism.natural_coordinates import cut
from alf_ros.model.constraints.couplings import coupling_row
from alf_ros.scene.text import repetition
from alf_ros.scene.text.repetition import Item
from alf_ros.scene.text.yaml_document import Entry

KEYS = ('joints',)


def read(
    section: Entry, mechanism: Mechanism, names: Mapping[str, float]
) -> Iterator[tuple[Item, Coupling]]:
    """Couplings of coordinates that the mechanism has. Raises InputError."""
    layout, coordinates = cut(mechanism), mechanism.coordinate
    for item in repetition.repeated(section, repetition.keys(KEYS, KEYS), names):
        entry = item.fields['joints']
        of = []
        for key, factor in entry.mapping().items():
            name = repetition.filled(key, factor, item.names)
            if name not in coordinates:
                raise factor.error('no such joint coordinate', value=name, choices=coordinates)
            a = factor.number(item.names)
            if a == 0.0:
                raise factor.error('it has no joint with a factor', value=0.0, expected='not zero')
            if coordinates[name].is_angle and not layout.turns(coordinates[name].joint.child):
                child = coordinates[name].joint.child
                raise factor.error(f'body {child!r} has one point only, which cannot turn')
            of.append((name, a))
        if not of:
            raise entry.error('no coordinate', expected='{joint: factor, joint: factor}')
        coupling = Coupling(item.name, tuple(of))
        try:
            coupling_row(coupling, layout)
        except ValueError as error:
            raise entry.error(str(error)) from None
        yield item, coupling
