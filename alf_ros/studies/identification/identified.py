"""The result of `identify`: numbers, how well they are determined, and residuals."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from alf_ros import html_table, paths
from alf_ros.arrays import Floats
from alf_ros.scene.scene import Scene
from alf_ros.studies import result_folder
from alf_ros.studies.identification.candidate_motion import Candidate
from alf_ros.studies.identification.candidate_motion import candidates as read_candidates
from alf_ros.studies.identification.design_runs import DesignRuns, checked_duration
from alf_ros.studies.identification.experiment_design import ExperimentDesign, ordered, untold
from alf_ros.studies.identification.identifiability import Combination, Knowledge
from alf_ros.studies.identification.recorded_names import Topics
from alf_ros.studies.identification.recording import Recording
from alf_ros.studies.identification.residual_tests import Whiteness
from alf_ros.studies.identification.shared_numbers import LONGEST_DELAY
from alf_ros.studies.identification.window import Window
from alf_ros.studies.identification.window_runs import WindowRuns
from alf_ros.studies.result_folder import REPORT

_DESIGN = 'design.json'
_BESIDE = 1e-3  # of a step: inputs as near to one act in time
_FAR = 1.5  # times its noise: residuals that the noise does not explain
_WIDE = 1.959963984540054  # standard deviations of a normal distribution around 95 % of it


@dataclass(frozen=True, eq=False)
class ChannelFit:
    """How well one measured quantity of a recording is met, in its unit (rad or m; per s for a
    velocity).

    noise: standard deviation that weighs it; noise_given: whether it was given, with a loss that
    expects it of all residuals. rms of the residuals: `before`, with the numbers of
    the scene and the best starts; `after` the fit; `held_out`: in the windows that were kept away,
    with the best starts, NaN without any. residuals and times: of each fitted window.
    """

    name: str
    recording: str
    unit: str
    kind: str
    noise: float
    noise_given: bool
    before: float
    after: float
    held_out: float
    whiteness: Whiteness
    times: Sequence[Floats]
    residuals: Sequence[Floats]

    @property
    def doubts(self) -> list[str]:
        """Why the intervals are too narrow, in words."""
        found = [] if self.whiteness.white else ['not white: the intervals are too narrow']
        ratio = self.after / self.noise
        if self.noise_given and ratio > _FAR:
            found.append(f'{ratio:.3g} times the given noise: the intervals are too narrow')
        return found


@dataclass(frozen=True, eq=False)
class Identification:
    """Numbers of a scene from recordings. The last name is 'delay' (s) if it was fitted.

    values, before (P,): found, and in the scene; place (P,): where the derivatives are taken, half
    a deviation from the values or less. `scene` as it was, `fitted_scene` with the new numbers.
    `settled`: whether the fit ended by itself, `reason`: why it did. bounds (P, 2): least and
    largest values, infinite without one; `at_bounds`: numbers that ended at one. `trouble`: steps
    of the runs that are too long, in words; empty if all are resolved. begins: how recordings
    were said to begin. starts: free numbers of each fitted window, of which `windows` has the
    meaning.
    """

    scene: Scene
    names: tuple[str, ...]
    values: Floats
    before: Floats
    knowledge: Knowledge
    place: Floats
    channels: tuple[ChannelFit, ...]
    fitted_scene: Scene
    recordings: tuple[Recording, ...]
    windows: tuple[Window, ...]
    kept_away: tuple[Window, ...]
    starts: tuple[Floats, ...]
    evaluations: int
    settled: bool
    reason: str
    bounds: Floats
    at_bounds: tuple[str, ...]
    trouble: str
    begins: str
    runs: WindowRuns = field(repr=False)

    @property
    def deviations(self) -> Floats:
        """Standard deviations (P,); infinite for a number in a combination that is not seen."""
        return self.knowledge.deviations

    @property
    def intervals(self) -> Floats:
        """(P, 2) of 95 %, for white noise, within the bounds.

        The best value without a bound lies behind it, or on it, where a number is at its bound. So
        the interval from there reaches as far as the one of that value, or further.
        """
        half = _WIDE * self.deviations
        ends = np.column_stack([self.values - half, self.values + half])
        return np.clip(ends, self.bounds[:, :1], self.bounds[:, 1:])

    @property
    def correlations(self) -> Floats:
        """(P, P) of the estimates; ±1 within a combination that is not seen."""
        return self.knowledge.correlations

    @property
    def singular_values(self) -> Floats:
        """(P,) descending: 1 / σ is how well a combination is known, relative."""
        return self.knowledge.singular

    @property
    def combinations(self) -> tuple[Combination, ...]:
        """Of the numbers, from the best known one to the least known one."""
        return self.knowledge.combinations

    @property
    def undetermined(self) -> tuple[Combination, ...]:
        """The combinations with a deviation of 100 % or more."""
        return tuple(each for each in self.combinations if not each.determined)

    @property
    def beside_inputs(self) -> list[str]:
        """Recordings whose inputs do not act at their times, in words: they act at whole steps.
        The intervals do not contain this error."""
        found, h = [], self.runs.h
        for each in self.recordings:
            beside = each.beside_steps(h)
            if beside > _BESIDE * h:
                found.append(
                    f'inputs of {each.name} act at steps of {h:g} s, up to {beside:.2g} s from '
                    'their times, which the intervals do not contain: take a shorter solver.step'
                )
        return found

    def __getitem__(self, name: str) -> float:
        """The value of a number."""
        return float(self.values[self.names.index(name)])

    def design(
        self,
        candidates: Sequence[Candidate] | Mapping[str, Candidate],
        *,
        duration: float | None = None,
        topics: Topics | None = None,
        report: Callable[[str], None] | None = None,
    ) -> ExperimentDesign:
        """Which of the candidates, as a further motion of the machine, tells most.

        A candidate is a scene (name, file, text as a mapping, Scene), which has the same numbers;
        a recording (folder, file, Recording), of which the inputs act on the fitted scene, from
        its first measured positions, if there are any; 'NAME=VALUE', the fitted scene with
        another value; or 'SCENE,NAME=VALUE' and 'RECORDING,NAME=VALUE'. duration (s): of all
        motions; None for the duration of each recording, or of the longest one of the fit.
        topics: names of recorded joints and topics. report: called with a line of text.

        Raises InputError for candidates that cannot be read, and scenes without the numbers or
        the measured joints.
        """
        span = checked_duration(duration)
        motions = read_candidates(candidates, self.fitted_scene, self.names, topics)
        steps = np.median([window.last - window.first for window in self.windows])
        runs = DesignRuns(
            self.runs,
            self.recordings,
            np.array([each.noise for each in self.channels]),
            self.place,
            self.knowledge,
            float(steps) * self.runs.h,
            LONGEST_DELAY if self.runs.delay else 0.0,
        )
        found = []
        for each in motions:
            if report is not None:
                report(f'candidate {each.name}')
            found.append(runs.motion(each, span))
        return ordered(self.names, self.knowledge, found)

    def lines(self) -> Iterator[str]:
        """The result as a terminal shows it."""
        width = max(map(len, self.names))
        for name, value, deviation, (low, high) in zip(
            self.names, self.values, self.deviations, self.intervals, strict=True
        ):
            shown, first, last = (rounded(x, deviation) for x in (value, low, high))
            shown_with = f'± {deviation:.2g}, 95 %: {first} to {last}'
            if not np.isfinite(deviation):
                shown, shown_with = f'{value:.2g}', 'not determined by this recording'
            bound = ', at its bound' if name in self.at_bounds else ''
            yield f'{name:{width}}  {shown} {shown_with}{bound}'
        for each in self.undetermined:
            yield untold(each)
        for channel in self.channels:
            unit = channel.unit + ('/s' if channel.kind == 'velocity' else '')
            held = f', {channel.held_out:.3g} kept away' if self.kept_away else ''
            name = channel.name
            if len(self.recordings) > 1:
                name += f' of {channel.recording}'
            yield (
                f'{name}: {channel.before:.3g} {unit} before, {channel.after:.3g} after'
                f'{held}{"".join(f", {each}" for each in channel.doubts)}'
            )
        for recording in self.recordings:
            if recording.damage:
                yield f'{recording.name} is damaged: {recording.damage}'
        yield from self.beside_inputs
        if not self.settled:
            yield f'the fit has not settled: {self.reason}'
        if self.trouble:
            yield f'the runs are not resolved: {self.trouble}'

    def __str__(self) -> str:
        return '\n'.join(self.lines())

    def __repr__(self) -> str:
        each = zip(self.names, self.values, self.deviations, strict=True)
        told = ', '.join(f'{name} {rounded(value, spread)}' for name, value, spread in each)
        return f'<Identification of {self.scene.name}: {told}>'

    def _repr_html_(self) -> str:
        """HTML for a notebook."""
        rows = zip(self.names, map(str, self.values), map(str, self.deviations), strict=True)
        head = ('number', 'value', 'standard deviation')
        return html_table.heading('Identification') + html_table.table(head, rows, len(self.names))

    def save(self, folder: str | Path, design: ExperimentDesign | None = None) -> Path:
        """Write `<scene>.yaml`, the scene with the new numbers, and `report.html` into a folder,
        which is made; returns it. A design is in the report, and in `design.json`. Raises
        OSError."""
        from alf_ros.studies.identification.identification_page import page

        scene = f'{self.scene.name}.yaml'
        # The report comes first: beside it the other files are those of this study.
        texts = {REPORT: page(self, design), scene: self.fitted_scene.text}
        if design is not None:
            texts[_DESIGN] = json.dumps(design.as_data(), indent=1, allow_nan=False) + '\n'
        return paths.written(folder, texts)


def check_folder(folder: Path, scene: Scene, with_design: bool, key: str) -> None:
    """Raise InputError, which says `key`, if the identification of a scene cannot be saved there,
    or only in place of other files."""
    from alf_ros.studies.identification.identification_page import title_of

    names = [f'{scene.name}.yaml', REPORT, *([_DESIGN] if with_design else [])]
    result_folder.check(folder, names, title_of(scene), key)


def rounded(value: float, deviation: float) -> str:
    """A number to a tenth of its deviation, with 3 digits at least, and 16 at most."""
    if not (np.isfinite(deviation) and deviation > 0.0 and value != 0.0):
        return f'{value:.4g}'
    digits = int(np.ceil(np.log10(abs(value) / deviation))) + 1
    return f'{value:.{min(16, max(3, digits))}g}'
