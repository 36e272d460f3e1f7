"""The summary of a log in words, beside its plots."""

from __future__ import annotations

from dataclasses import dataclass, field

from alf_ros.errors import AlfError
from alf_ros.logs import input_faults, progress
from alf_ros.logs.log import Log
from alf_ros.logs.report.drawn_motion import DrawnMotion, mechanism, motion
from alf_ros.logs.report.gather import Gathered, gather
from alf_ros.logs.report.singularity_distance import reported
from alf_ros.simulation.quantities import ONE_OF_MANY

Text = tuple[float, int, str]


@dataclass
class Account:
    """`about`: (what, text); `notes`: omissions; `faults`: faults of the log; `texts`: (t, level,
    text) of commands, passes and warnings in the order of time. Times in s."""

    name: str
    scene: str
    found: Gathered
    motion: DrawnMotion | None
    first: float
    last: float
    about: list[tuple[str, str]]
    notes: list[str]
    faults: list[str] = field(default_factory=list)
    texts: list[Text] = field(default_factory=list)

    @property
    def is_exact(self) -> bool:
        """Whether passes are known from every state of the log."""
        return self.motion is not None and self.motion.passes is not None

    @property
    def passes(self) -> list[tuple[float, float]]:
        """(from, to) s, equal where the time of a pass is known."""
        if self.motion is not None and self.motion.passes is not None:
            return [(t, t) for t, _, _ in self.motion.passes]
        return reported(self.found.reports)


def account(log: Log, report: progress.Report = progress.silent) -> Account:
    """Go through a log once, then through the frames of its mechanism."""
    found = gather(log, report)
    first, last = (found.first, found.last) if found.counts else (0.0, 0.0)
    drawn, why = None, 'the log has no states of its mechanism'
    if found.states:
        try:
            drawn = motion(found, mechanism(log), report)
        except AlfError as error:
            why = str(error)
    name = log.path.stem if log.path.is_file() else log.path.resolve().name
    made = Account(name, log.info['scene'], found, drawn, first, last, _about(log, found), [])
    made.notes = _notes(made, why)
    made.faults = [fault for fault in (found.damage, log.absent) if fault]
    made.faults += input_faults.of_types(log, found.types)
    made.faults += [
        f'{count} messages of {topic} are missing' for topic, count in found.lost.items()
    ]
    made.texts = _texts(made)
    return made


def _about(log: Log, found: Gathered) -> list[tuple[str, str]]:
    solver = {key: value for key, value in log.info['solver'].items() if value is not None}
    versions = log.versions
    count = sum(found.counts.values())
    span = f'{found.first:.9g} to {found.last:.9g} s, {count} messages' if count else 'empty'
    makers = (f'{key} {versions[key]}' for key in ('alf_ros', 'cpu') if key in versions)
    told = [
        ('file', str(log.path)),
        ('scene', f'{log.info["scene"]}, SHA-256 {log.info["scene_sha256"][:16]}'),
        ('solver', ', '.join(f'{key} {_short(value)}' for key, value in solver.items())),
        ('time', span),
        ('made by', ', '.join(makers)),
    ]
    parent = log.info.get('parent')
    if parent:
        changes = ', '.join(f'{key} = {value}' for key, value in parent.get('changes', {}).items())
        told.append(
            ('fork', f'of {parent.get("log", "a log")} at t = {parent.get("t")} s: {changes}')
        )
    if found.reports.open_joints:
        names = ', '.join(found.reports.open_joints)
        told.append(('indeterminate', f'reactions of {names}: {ONE_OF_MANY}'))
    if found.reports.open_drives:
        names = ', '.join(found.reports.open_drives)
        told.append(('indeterminate', f'efforts of {names}: {ONE_OF_MANY}'))
    if found.worst[0]:
        told.append(('worst', f'constraint {found.worst[1]}: |Φ| = {found.worst[0]:.3g}'))
    return told


def _short(value: object) -> str:
    return f'{value:g}' if isinstance(value, float) else str(value)


def _notes(made: Account, why: str) -> list[str]:
    """Omissions, so that the page is not mistaken for the complete log."""
    found, notes = made.found, []
    groups = sorted({s.trace.group for s in found.signals.values()} - {1})
    if groups:
        sizes = ' or '.join(map(str, groups))
        notes.append(f'plots: of each {sizes} messages the lowest and the highest value')
    if made.motion is None:
        notes.append(f'no animation: {why}')
    elif made.motion.stride > 1:
        spacing = made.motion.t[1] - made.motion.t[0]
        notes.append(f'animation: every {made.motion.stride}th state, {spacing:.3g} s apart')
    if made.motion is not None:
        notes += [f'not drawn: {fault}' for fault in made.motion.missing]
    if not made.is_exact:
        notes.append('singular positions: from the diagnostics, to the second')
    if found.orders.stride > 1:
        notes.append(f'commands: every {found.orders.stride}th of {found.orders.count} is listed')
    return notes


def _texts(made: Account) -> list[Text]:
    texts = [(t, 0, text) for t, text in made.found.orders.texts] + made.found.reports.texts
    for t, sigma, through in (made.motion and made.motion.passes) or []:
        what = 'pass through a singular position' if through else 'close to a singular position'
        texts.append((t, 1, f'{what}, distance {sigma:.2g}'))
    return sorted(texts)
