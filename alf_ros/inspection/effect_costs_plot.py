"""Draw the costs of effects: what each effect costs beside what difference it makes."""

from __future__ import annotations

import math
from pathlib import Path

from alf_ros.inspection.effect_costs import EffectCosts
from alf_ros.paths import replacing

_SMALLEST = 1e-16  # m, drawn as nothing


def draw(path: Path, title: str, found: EffectCosts) -> None:
    """Write the picture.

    Raises ImportError without matplotlib, OSError if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    costs = found.effects[::-1]  # the first one on top
    names, places = [effect.label for effect in costs], list(range(len(costs)))
    figure = Figure(figsize=(13.0, 1.8 + 0.45 * len(costs)), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(f'{title}: {found.bare:.2f} µs a step without effects, {found.whole:.2f} with')
    cost, change, steps = figure.subplots(1, 3, sharey=True)
    cost.barh([y + 0.2 for y in places], [p.added for p in costs], 0.38, label='added alone')
    cost.barh([y - 0.2 for y in places], [p.removed for p in costs], 0.38, label='of them all')
    cost.axvspan(-found.resolution, found.resolution, color='0.9', zorder=0, label='resolution')
    cost.set(xlabel='cost, µs per step', yticks=places)
    cost.set_yticklabels(names)
    cost.legend(loc='best', fontsize='small')
    shown = [
        effect.change if _SMALLEST < effect.change < math.inf else math.nan for effect in costs
    ]
    change.plot(shown, places, 'o', color='#d55e00')
    across = change.get_yaxis_transform()  # fractions along x, data along y
    for y, effect in zip(places, costs, strict=True):
        if effect.change == math.inf:
            change.text(0.02, y, 'does not run without', va='center', transform=across)
        elif effect.change <= _SMALLEST:
            change.text(0.02, y, 'none', va='center', transform=across)
    if any(x == x for x in shown):
        change.set_xscale('log')
    else:
        change.set_xticks([])
    change.set(xlabel='change of position it makes, m', ylim=(-0.6, len(costs) - 0.4))
    for method, marker in (('rk4', 's'), ('dop853', 'D')):
        longest = [effect.mode.step(method) for effect in costs]
        stable = [h if h < math.inf else math.nan for h in longest]
        steps.plot(stable, places, marker, label=method)
    for y, effect in zip(places, costs, strict=True):
        if effect.mode.rate == 0.0:
            across = steps.get_yaxis_transform()
            steps.text(0.02, y, 'any', va='center', transform=across)
    if any(effect.mode.rate > 0.0 for effect in costs):
        steps.set_xscale('log')
        steps.legend(loc='best', fontsize='small')
    else:
        steps.set_xticks([])
    steps.set(xlabel='longest stable step, s')
    for axes in (cost, change, steps):
        axes.grid(True, axis='x', color='0.92')
        axes.set_axisbelow(True)
    with replacing(path) as target:
        figure.savefig(target, dpi=120)
