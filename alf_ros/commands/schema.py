"""Write the JSON schemas of mechanism and scene files, which editors use.

Those that come with the package know its own effects; these know in addition what other packages
register as effects on this machine.
"""

from __future__ import annotations

from collections.abc import Sequence

from alf_ros import effects
from alf_ros.commands.parser import Parser, add_folder, writing_into
from alf_ros.scene.json_schema import mechanism_schema, scene_schema, text


def main(argv: Sequence[str] | None = None) -> int:
    """Write both schemas. Returns 0; raises InputError."""
    parser = Parser(
        prog='schema',
        description='Write mechanism.json and scene.json: JSON schemas for editors, with all '
        'effects that are installed.',
    )
    add_folder(parser, 'schema', 'where to')
    options = parser.parse_args(argv)
    made = {'mechanism': mechanism_schema(), 'scene': scene_schema(effects.kinds())}
    with writing_into(options.folder) as folder:
        for name, schema in made.items():
            (folder / f'{name}.json').write_text(text(schema), encoding='utf-8')
    print(f'mechanism.json and scene.json in {folder}')
    return 0
