"""A moving picture of logs, side by side: GIF, WebP or MP4, made without a browser.

Every panel shows one mechanism at the same simulated time. A bar is red while the mechanism passes
a singular position. Mechanisms in space are seen from the side above, in parallel projection.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.logs import progress
from alf_ros.logs.report.drawn_motion import DrawnMotion
from alf_ros.logs.report.gather import Label
from alf_ros.logs.report.shape_outlines import outlines
from alf_ros.logs.report.summary import Account
from alf_ros.mechanism import VisualShape
from alf_ros.paths import replacing

FORMATS = ('.gif', '.webp', '.mp4')
FPS = 25.0  # pictures per second
MOST_PICTURES = 5000
_TRAIL = 0.6  # s of wall clock that the path of a joint stays visible
_MARK = 0.7  # of the radius: where the mark of a wheel begins
_RED_FOR = 0.12  # s of wall clock before and after a pass in which bars are red
_WIDTH, _TALLEST = 9.0, 4.5  # inches, of the whole picture and of a panel
_DPI = 90
INK, FAINT, BAR, RED = '#22303c', '#8b98a3', '#1f6fb2', '#c0272d'
_ELEVATION, _AZIMUTH = np.radians(22.0), np.radians(-60.0)


@dataclass(frozen=True)
class Film:
    """Contents of one panel. t (k,) s; places (k, points, 2) m on the picture; energy J (k,), NaN
    where the log has none; `title` stands above the panel; films of one scene share a scale."""

    title: str
    scene: str
    motion: DrawnMotion
    t: Floats
    places: Floats
    energy: Floats
    passes: Floats

    def at(self, t: float) -> int:
        """The last frame that is not after t (s)."""
        return max(0, int(np.searchsorted(self.t, t, side='right')) - 1)


def film(account: Account, title: str) -> Film:
    """The film of an account. Raises InputError if its log has no states of its mechanism."""
    motion = account.motion
    if motion is None:
        reason = next((n for n in account.notes if n.startswith('no animation')), 'no animation')
        raise InputError(reason, file=account.name)
    order = np.argsort(motion.t, kind='stable')
    t, places = motion.t[order], motion.places[order]
    passes = np.array([at for at, _, through in motion.passes or [] if through])
    return Film(
        title=title,
        scene=account.scene,
        motion=motion,
        t=t,
        places=projected(places, motion.spatial),
        energy=_energy(account, t),
        passes=passes,
    )


def titles(accounts: Sequence[Account], solvers: Sequence[Mapping[str, object]]) -> list[str]:
    """A title for each log: its scene, or the solver settings in which the logs differ."""
    scenes = [account.scene for account in accounts]
    keys = [key for key in solvers[0] if len({str(each.get(key)) for each in solvers}) > 1]
    if len(set(scenes)) > 1 or not keys:
        return scenes if len(set(scenes)) == len(scenes) else [each.name for each in accounts]
    return [', '.join(f'{key}: {each.get(key)}' for key in keys) for each in solvers]


def check_format(path: Path) -> None:
    """Raises InputError for a file that is not in FORMATS."""
    if path.suffix.lower() not in FORMATS:
        expected = ', '.join(FORMATS)
        raise InputError(
            'no format of a moving picture', key='--animation', value=str(path), expected=expected
        )


def write(
    path: Path,
    films: Sequence[Film],
    speed: float = 1.0,
    report: progress.Report = progress.silent,
) -> int:
    """Write the moving picture; returns the number of its pictures.

    `speed`: simulated seconds per second. Raises InputError for a format that is not in FORMATS or
    that needs a program that is missing, for a film that is too long, and if the file cannot be
    written; ImportError without matplotlib.
    """
    check_format(path)
    first, last = min(each.t[0] for each in films), max(each.t[-1] for each in films)
    count = round((last - first) / speed * FPS) + 1
    if count > MOST_PICTURES:
        fits = (last - first) * FPS / MOST_PICTURES
        raise InputError(
            f'the film would have {count} pictures',
            key='--speed',
            value=f'{speed:g}',
            expected=f'at least {fits:.3g} simulated seconds per second, for {MOST_PICTURES}',
        )
    times = first + np.arange(count) * speed / FPS
    try:
        write_film = _write_mp4 if path.suffix.lower() == '.mp4' else _write_image
        with replacing(path) as target:
            write_film(target, films, times, speed, report)
    except OSError as error:
        raise InputError(f'cannot be written: {error.strerror or error}', file=str(path)) from None
    return count


def _box(films: Sequence[Film]) -> tuple[Floats, Floats]:
    """The corners (2,) m of what the films need, with a margin."""
    rims = [_rims(each.places, each.motion.wheels, 8) for each in films]
    others = [_other_ends(each.places[:, each.motion.shape_points]) for each in films]
    shown = [*(each.places for each in films), *rims, *others]
    places = np.concatenate([each.reshape(-1, 2) for each in shown])
    places = places[np.isfinite(places).all(axis=1)]
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.06 * max(high - low) or 1.0
    return low - margin, high + margin


def _other_ends(places: Floats) -> Floats:
    """The ends of half axes on the other side, of shapes with four places each, middle and ends:
    (…, shapes, 4, 2) of (…, 4 shapes, 2)."""
    ends = places.reshape(*places.shape[:-2], -1, 4, 2)
    return 2.0 * ends[..., :1, :] - ends


def _rims(places: Floats, wheels: list[int], parts: int) -> Floats:
    """(…, wheels, parts + 2, 2): the rim of each wheel, closed, and before it a place inside, for
    a mark that shows how the wheel turns. places: (…, points, 2)."""
    of = places[..., np.array(wheels, dtype=int), :].reshape(*places.shape[:-2], -1, 3, 1, 2)
    centre, a, b = of[..., 0, :, :], of[..., 1, :, :], of[..., 2, :, :]
    angle = np.linspace(0.0, 2.0 * np.pi, parts + 1)[:, None]
    rim = centre + np.cos(angle) * (a - centre) + np.sin(angle) * (b - centre)
    return np.concatenate([centre + _MARK * (a - centre), rim], axis=-2)


class Screen:
    """A matplotlib figure with one panel for each film."""

    def __init__(self, films: Sequence[Film], speed: float) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        self._films, self._speed = films, speed
        boxes = [_box([other for other in films if other.scene == each.scene]) for each in films]
        wide = _WIDTH / len(films)
        shape = max((high - low)[1] / (high - low)[0] for low, high in boxes)
        tall = min(_TALLEST, max(1.5, wide * shape))
        # Even numbers of pixels: encoders of MP4 want them.
        pixels = [2 * round(0.5 * _DPI * inches) for inches in (_WIDTH, tall + 0.75)]
        self.figure = Figure(figsize=(pixels[0] / _DPI, pixels[1] / _DPI), dpi=_DPI)
        self.canvas = FigureCanvasAgg(self.figure)
        self._panels = [
            _Panel(self.figure.add_subplot(1, len(films), n + 1), each, *boxes[n])
            for n, each in enumerate(films)
        ]
        bottom = 0.42 / (tall + 0.75)
        self.figure.subplots_adjust(
            left=0.01, right=0.99, bottom=bottom, top=1.0 - 0.33 / (tall + 0.75), wspace=0.04
        )

    def show(self, t: float) -> None:
        """Draw the instant t (s)."""
        for panel in self._panels:
            panel.show(t, self._speed)

    def pixels(self) -> Any:
        """(height, width, 3) bytes of the last picture."""
        self.canvas.draw()
        return np.asarray(self.canvas.buffer_rgba())[..., :3]


class _Panel:
    """One mechanism, drawn again and again with the same artists."""

    def __init__(self, axes: Any, shown: Film, low: Floats, high: Floats) -> None:
        from matplotlib.collections import LineCollection, PolyCollection

        self._film, motion = shown, shown.motion
        self._links = np.array(motion.links, dtype=int).reshape(-1, 2)
        self._pins = np.array(motion.pins, dtype=int)
        still = np.ptp(shown.places, axis=0).max(axis=1) < 1e-9 * float(max(high - low))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        axes.set_aspect('equal')
        axes.axis('off')
        axes.set_title(shown.title, fontsize=11, color=INK)
        ends = np.unique(self._links)
        self._moving = np.array([n for n in ends if not still[n]], dtype=int)
        grounded = [n for n in (*ends, *self._pins) if still[n]]
        places = shown.places[0, grounded]
        axes.plot(*places.T, linestyle='none', marker='^', markersize=11, color=INK, zorder=1)
        self._shapes = PolyCollection([], linewidths=0.8, zorder=1)
        self._shapes.set_facecolor([_rgba(shape, 0.25) for shape in motion.shapes])
        self._shapes.set_edgecolor([_rgba(shape, 0.6) for shape in motion.shapes])
        self._wheels = LineCollection([], colors=BAR, linewidths=1.5, zorder=2)
        self._symbols = LineCollection([], colors=INK, linewidths=0.9, zorder=4)
        self._trails = LineCollection([], colors=FAINT, linewidths=0.9, alpha=0.6, zorder=2)
        self._bars = LineCollection(
            [], linewidths=2.0 if motion.shapes else 4.0, capstyle='round', zorder=3
        )
        for lines in (self._shapes, self._wheels, self._symbols, self._trails, self._bars):
            axes.add_collection(lines, autolim=False)
        style = {'linestyle': 'none', 'marker': 'o', 'markersize': 6, 'markeredgecolor': INK}
        (self._joints,) = axes.plot([], [], markerfacecolor='white', zorder=4, **style)
        self._text = axes.text(
            0.5, -0.02, '', transform=axes.transAxes, ha='center', va='top', fontsize=10, color=INK
        )

    def show(self, t: float, speed: float) -> None:
        shown = self._film
        k, since = shown.at(t), shown.at(t - _TRAIL * speed)
        places = shown.places[k]
        self._bars.set_segments(list(places[self._links]))
        near = np.abs(shown.passes - t).min(initial=np.inf) <= _RED_FOR * speed
        self._bars.set_color(RED if near else BAR)
        at = places[np.array(shown.motion.shape_points, dtype=int)]
        self._shapes.set_verts(outlines(shown.motion.shapes, shown.motion.meshes, at))
        self._wheels.set_segments(list(_rims(places, shown.motion.wheels, 72)))
        ends = places[np.array(shown.motion.symbols, dtype=int)]
        self._symbols.set_segments(list(ends.reshape(-1, 2, 2)))
        trail = shown.places[since : k + 1, self._moving]
        self._trails.set_segments(list(trail.swapaxes(0, 1)) if len(trail) > 1 else [])
        self._joints.set_data(*places[self._pins].T)
        text = f't = {t:.2f} s'
        gain = shown.energy[k] - shown.energy[0]
        if np.isfinite(gain):
            text += f'    energy change {gain:+.2g} J'
        if t > shown.t[-1]:
            text += '    the log ends'
        self._text.set_text(text)


def _pictures(screen: Screen, times: Floats, report: progress.Report) -> Iterator[Any]:
    for number, t in enumerate(times):
        screen.show(float(t))
        yield screen.pixels()
        report((number + 1) / len(times))


def _write_image(
    path: Path, films: Sequence[Film], times: Floats, speed: float, report: progress.Report
) -> None:
    from PIL import Image

    screen = Screen(films, speed)
    frames: Iterator[Any] = (Image.fromarray(each) for each in _pictures(screen, times, report))
    is_gif = path.suffix.lower() == '.gif'
    if is_gif:  # with one palette for all, a picture differs from the last only where bars moved
        palette = Image.new('P', (1, 1))
        palette.putpalette(_palette([shape for film in films for shape in film.motion.shapes]))
        frames = (each.quantize(palette=palette, dither=Image.Dither.NONE) for each in frames)
    options: dict[str, Any] = {'optimize': True} if is_gif else {'quality': 60, 'method': 4}
    next(frames).save(
        path,
        save_all=True,
        append_images=frames,
        duration=round(1000.0 / FPS),
        loop=0,
        **options,
    )


def _rgba(shape: VisualShape, part: float = 1.0) -> tuple[float, float, float, float]:
    """The colour of a shape, with this part of its opacity."""
    from matplotlib.colors import to_rgba

    r, g, b, opacity = shape.color or to_rgba(BAR)
    return r, g, b, part * opacity


def _palette(shapes: Sequence[VisualShape]) -> list[int]:
    """Colours of the picture in 12 shades from white, as red, green, blue, red, …; 256 at most."""
    from matplotlib.colors import to_rgb

    shades = np.linspace(0.0, 1.0, 12)[:, None]
    base = [to_rgb(each) for each in (INK, FAINT, BAR, RED)]
    given = dict.fromkeys([*base, *(_rgba(shape)[:3] for shape in shapes)])
    colours = [1.0 - shades * (1.0 - np.array(each)) for each in list(given)[: 256 // 12]]
    numbers: list[int] = np.round(255.0 * np.concatenate(colours)).astype(int).ravel().tolist()
    return numbers


def _write_mp4(
    path: Path, films: Sequence[Film], times: Floats, speed: float, report: progress.Report
) -> None:
    from matplotlib.animation import FFMpegWriter

    if not FFMpegWriter.isAvailable():
        raise InputError(
            'MP4 needs the program ffmpeg',
            key='--animation',
            value=path.suffix,
            expected='.gif or .webp, or ffmpeg installed',
        )
    screen = Screen(films, speed)
    writer = FFMpegWriter(fps=round(FPS), codec='libx264', extra_args=['-pix_fmt', 'yuv420p'])
    with writer.saving(screen.figure, str(path), _DPI):
        for _ in _pictures(screen, times, report):
            writer.grab_frame()


def _energy(account: Account, t: Floats) -> Floats:
    """The energy (J) at times t (s); NaN without the topic, or where the log has not yet any."""
    label = (Label('energy', 'energy'),)
    if label not in account.found.signals:
        return np.full(len(t), np.nan)
    trace = account.found.signals[label].trace
    rows = np.maximum(np.searchsorted(trace.t, t, side='right') - 1, 0)
    return trace.low[rows, 0]


def projected(places: Floats, spatial: bool) -> Floats:
    """(…, 3) m -> (…, 2) m on the picture."""
    if not spatial:
        return places[..., :2]
    right = np.array([-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0])
    up = np.array(
        [
            -np.sin(_ELEVATION) * np.cos(_AZIMUTH),
            -np.sin(_ELEVATION) * np.sin(_AZIMUTH),
            np.cos(_ELEVATION),
        ]
    )
    return places @ np.column_stack([right, up])
