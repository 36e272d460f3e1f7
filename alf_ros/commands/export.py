"""Write the spanning tree of a mechanism as URDF, and its loops as a side file.

`import` reads both back: the side file holds the positions of the joints as drawn, and the joints
that are not in the tree.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from alf_ros import paths
from alf_ros.commands.parser import Parser, add_numbers, numbers, refuse_source, writing
from alf_ros.exchange.export import exported, tree
from alf_ros.scene.library import load


def main(argv: Sequence[str] | None = None) -> int:
    """Export a mechanism. Returns 0; raises InputError."""
    parser = Parser(
        command='export',
        description='Write the spanning tree of a mechanism as URDF, for RViz and other programs. '
        'Everything that is not exported is listed on stderr.',
    )
    parser.add_argument('file', metavar='FILE', help='name or path of a scene or mechanism')
    parser.add_argument(
        '-o', '--output', metavar='OUT.urdf', help='file to write (default: stdout)'
    )
    parser.add_argument(
        '--loops',
        metavar='SIDE.yaml',
        help='also write the joints that close loops, as a side file for `import --loops`',
    )
    add_numbers(parser)
    options = parser.parse_args(argv)
    scene = load(options.file, numbers(options.set))
    text, side, left_out = exported(scene)
    if options.loops is None:
        text, left_out = tree(scene)
    for key, path in (('-o', options.output), ('--loops', options.loops)):
        refuse_source(key, path, [options.file])
    for key, path, content in (('-o', options.output, text), ('--loops', options.loops, side)):
        if path is not None:
            with writing(key, path):
                paths.put(paths.named(path), content)
    if options.output is None:
        print(text, end='')
    for line in dict.fromkeys(left_out):
        print(f'not carried over: {line}', file=sys.stderr)
    return 0
