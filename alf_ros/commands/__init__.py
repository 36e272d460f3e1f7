"""The commands: one verb, one file, one line in the table; parse, call, print.

A command is a module with a docstring, whose first line is its help, and
`main(argv: Sequence[str] | None = None) -> int`. A line here makes it `python -m alf_ros <name>`
and `ros2 run alf_ros <name>`: setup.py reads this table too, so nothing may be imported here.
"""

COMMANDS = {
    'simulator': 'alf_ros.commands.simulator',
    'view': 'alf_ros.commands.view',
    'close': 'alf_ros.commands.close',
    'check': 'alf_ros.commands.check',
    'equilibrium': 'alf_ros.commands.equilibrium',
    'linearise': 'alf_ros.commands.linearise',
    'modes': 'alf_ros.commands.modes',
    'loads': 'alf_ros.commands.loads',
    'atlas': 'alf_ros.commands.atlas',
    'hard_cases': 'alf_ros.commands.hard_cases',
    'ensemble': 'alf_ros.commands.ensemble',
    'gradient': 'alf_ros.commands.gradient',
    'identify': 'alf_ros.commands.identify',
    'optimise': 'alf_ros.commands.optimise',
    'work_precision': 'alf_ros.commands.work_precision',
    'figures': 'alf_ros.commands.figures',
    'analyze': 'alf_ros.commands.analyze',
    'verify': 'alf_ros.commands.verify',
    'recover': 'alf_ros.commands.recover',
    'fork': 'alf_ros.commands.fork',
    'replay': 'alf_ros.commands.replay',
    'effects': 'alf_ros.commands.effects',
    'schema': 'alf_ros.commands.schema',
    'import': 'alf_ros.commands.import_',
    'export': 'alf_ros.commands.export',
}
