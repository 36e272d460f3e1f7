"""Draw a price list: what each effect costs beside what difference it makes."""

from __future__ import annotations

import math
from pathlib import Path

from alf_ros.inspection.effect_costs import PriceList

_SMALLEST = 1e-16  # m, drawn as nothing


def draw(path: Path, title: str, found: PriceList) -> None:
    """Write the picture.

    Raises ImportError without matplotlib, OSError if the file cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    prices = found.prices[::-1]  # the first one on top
    names, places = [price.effect for price in prices], list(range(len(prices)))
    figure = Figure(figsize=(13.0, 1.8 + 0.45 * len(prices)), layout='constrained')
    FigureCanvasAgg(figure)
    figure.suptitle(f'{title}: {found.bare:.2f} µs a step without effects, {found.whole:.2f} with')
    cost, change, steps = figure.subplots(1, 3, sharey=True)
    cost.barh([y + 0.2 for y in places], [p.added for p in prices], 0.38, label='added alone')
    cost.barh([y - 0.2 for y in places], [p.removed for p in prices], 0.38, label='of them all')
    cost.axvspan(-found.resolution, found.resolution, color='0.9', zorder=0, label='resolution')
    cost.set(xlabel='cost, µs per step', yticks=places)
    cost.set_yticklabels(names)
    cost.legend(loc='best', fontsize='small')
    shown = [price.change if _SMALLEST < price.change < math.inf else math.nan for price in prices]
    change.plot(shown, places, 'o', color='#d55e00')
    across = change.get_yaxis_transform()  # fractions along x, data along y
    for y, price in zip(places, prices, strict=True):
        if price.change == math.inf:
            change.text(0.02, y, 'does not run without', va='center', transform=across)
        elif price.change <= _SMALLEST:
            change.text(0.02, y, 'none', va='center', transform=across)
    if any(x == x for x in shown):
        change.set_xscale('log')
    else:
        change.set_xticks([])
    change.set(xlabel='change of position it makes, m', ylim=(-0.6, len(prices) - 0.4))
    for method, marker in (('rk4', 's'), ('dop853', 'D')):
        longest = [price.mode.step(method) for price in prices]
        stable = [h if h < math.inf else math.nan for h in longest]
        steps.plot(stable, places, marker, label=method)
    for y, price in zip(places, prices, strict=True):
        if price.mode.rate == 0.0:
            across = steps.get_yaxis_transform()
            steps.text(0.02, y, 'any', va='center', transform=across)
    if any(price.mode.rate > 0.0 for price in prices):
        steps.set_xscale('log')
        steps.legend(loc='best', fontsize='small')
    else:
        steps.set_xticks([])
    steps.set(xlabel='longest stable step, s')
    for axes in (cost, change, steps):
        axes.grid(True, axis='x', color='0.92')
        axes.set_axisbelow(True)
    figure.savefig(path, dpi=120)
