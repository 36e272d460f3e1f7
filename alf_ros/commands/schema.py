"""Write the JSON schemas of mechanism and scene files, for editors.

The schemas in the package contain the effects of the package. The schemas that this command writes
also contain the effects that other packages on this machine register.
"""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros import effects, paths
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.scene.json_schema import mechanism_schema, scene_schema, text


def main(argv: Sequence[str] | None = None) -> int:
    """Write both schemas. Returns 0; raises InputError."""
    parser = Parser(
        command='schema',
        description='Write mechanism.json and scene.json, JSON schemas for editors, with all '
        'installed effects.',
    )
    add_folder(parser, 'schema', 'folder for the schemas')
    options = parser.parse_args(argv)
    made = {'mechanism': mechanism_schema(), 'scene': scene_schema(effects.kinds())}
    with writing_into(options.folder) as folder:
        for name, schema in made.items():
            paths.put(folder / f'{name}.json', text(schema))
    print(f'mechanism.json and scene.json in {folder}')
    return 0
