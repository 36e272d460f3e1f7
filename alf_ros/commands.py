"""The commands of this package, in the order in which help lists them.

A command is a module with a docstring, whose first line is its help, and
`main(argv: Sequence[str] | None = None) -> int`. A line here makes it `python -m alf_ros <name>`
and `ros2 run alf_ros <name>`: setup.py reads this table too, so nothing may be imported here.
"""

COMMANDS = {
    'simulator': 'alf_ros.node',
    'view': 'alf_ros.view',
    'check': 'alf_ros.check',
    'hard_cases': 'alf_ros.hard_cases',
    'work_precision': 'alf_ros.work_precision',
    'figures': 'alf_ros.figures',
    'analyze': 'alf_ros.analysis.analyze',
    'verify': 'alf_ros.logs.verify',
    'recover': 'alf_ros.recover',
    'fork': 'alf_ros.fork',
    'replay': 'alf_ros.replay',
    'effects': 'alf_ros.effects_command',
    'schema': 'alf_ros.schema_command',
    'import': 'alf_ros.import_command',
    'export': 'alf_ros.export_command',
}
