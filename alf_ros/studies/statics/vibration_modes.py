"""`alf_ros.modes`: the lowest natural frequencies of a mechanism at rest, and who moves in them.

The modes are those without damping: (K + L - ω² M) x = 0 on the free directions. The damping of a
mode is yᵀ C x / 2ω, the share that damping takes if it is small. `linearise` has the exact ones.
y is x if the loads have a potential, else the left partner of x.

Energies: of the kinetic energy of a mode the share of each body and each rotor, and of its
potential energy (½ ω² for unit mass) the share of each effect, -½ xᵀ (∂Q_e/∂q) x, and of the
reactions, ½ xᵀ L x.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from alf_ros.arrays import Floats
from alf_ros.errors import InputError
from alf_ros.model.mass import mass_of
from alf_ros.scene.scene import SceneSource
from alf_ros.simulation.input_checks import whole
from alf_ros.simulation.simulation import Simulation
from alf_ros.studies.statics.constrained_solve import ConstrainedSolve
from alf_ros.studies.statics.creeping_friction import creeping
from alf_ros.studies.statics.descent import pushed
from alf_ros.studies.statics.force_change import STEPS
from alf_ros.studies.statics.instant import DENSE, Instant, Loads
from alf_ros.studies.statics.lowest_modes import lowest
from alf_ros.studies.statics.positions_of_rest import Equilibrium, equilibrium, in_order
from alf_ros.studies.statics.rest_stability import reduced_modes, reduced_stiffness
from alf_ros.studies.statics.sparse_rows import mass_matrix

REACTIONS = 'reactions'


@dataclass(frozen=True, eq=False)
class VibrationModes:
    """Modes at a position of rest, the lowest first.

    squares (k,): ω², 1/s²; NaN of a pair that flutters. motions (k, n): in the kernel's order, of
    unit mass, kg^-½; partners (k, n): their left partners. instant, and lam (rows,): where they
    are modes, and its multipliers.
    """

    instant: Instant
    lam: Floats
    squares: Floats
    motions: Floats
    partners: Floats

    def __repr__(self) -> str:
        told = ', '.join(f'{each:.4g}' for each in self.frequencies[:3])
        more = ', ...' if self.squares.size > 3 else ''
        return f'<VibrationModes: {self.squares.size}, at {told}{more} Hz>'

    @property
    def frequencies(self) -> Floats:
        """(k,) ω / 2π, Hz; NaN of a motion that falls or flutters."""
        return np.sqrt(np.where(self.squares >= 0.0, self.squares, np.nan)) / (2.0 * math.pi)

    @cached_property
    def damping_ratios(self) -> Floats:
        """(k,) yᵀ C x / 2ω; NaN of a motion that falls, flutters, or that nothing brings back."""
        loss = np.einsum('kn,kn->k', self.partners, (self.instant.C @ self.motions.T).T)
        rates = np.sqrt(np.where(self.squares > 0.0, self.squares, np.nan))
        return np.asarray(loss / (2.0 * rates))

    @property
    def notes(self) -> tuple[str, ...]:
        """Of the damping ratios: where they hold."""
        return tuple(creeping(self.instant))

    @cached_property
    def shapes(self) -> Floats:
        """(k, n) motions in the order of `Sample.q`, the largest number of each 1."""
        ordered = in_order(self.instant.model, self.motions)
        if not ordered.size:
            return ordered
        peak = ordered[np.arange(len(ordered)), np.argmax(np.abs(ordered), axis=1)]
        return np.asarray(ordered / peak[:, None])

    @cached_property
    def kinetic_shares(self) -> Mapping[str, Floats]:
        """(k,) of each body and each rotor ('motor.a.rotor'): its share of the kinetic energy.
        Their sum is 1."""
        model, shares = self.instant.model, dict[str, Floats]()
        for body in model.mechanism.bodies:
            alone = replace(model.mechanism, bodies=(body,), rotors=())
            layout = replace(model.layout, mechanism=alone)
            system = replace(model.system, mass=mass_of(layout))
            own = mass_matrix(replace(model, system=system)) @ self.motions.T
            shares[body.name] = np.einsum('kn,nk->k', self.motions, own)
        layout = model.layout
        blocks = self.motions.reshape(len(self.motions), layout.movable, layout.dimension)
        for rotor in model.mechanism.rotors:  # each is a block of its own
            block = model.layout.of_auxiliary[rotor.name]
            speeds = (blocks[:, block : block + 1] ** 2).sum(axis=(1, 2))
            shares[rotor.name] = model.system.mass.diagonal[block : block + 1].sum() * speeds
        return shares

    @cached_property
    def potential_shares(self) -> Mapping[str, Floats]:
        """(k,) of each effect, and of the 'reactions': its share of the potential energy ½ ω²;
        NaN of a motion that nothing brings back. Shares may be negative, their sum is 1."""
        instant = self.instant
        found = {label: self._stored(label) for label in instant.loads.applied.each}
        L = instant.curvature(self.lam)
        found[REACTIONS] = np.einsum('kn,nk->k', self.motions, L @ self.motions.T)
        whole = np.where(np.abs(self.squares) > 0.0, self.squares, np.nan)
        return {label: np.asarray(each / whole) for label, each in found.items()}

    def _stored(self, label: str) -> Floats:
        """(k,) -xᵀ (∂Q_e/∂q) x of one effect, 1/s²."""
        instant, n = self.instant, self.instant.model.n
        change, stored = instant.change(label), np.zeros(len(self.motions))
        length, along = instant.loads.tangents.length, np.zeros_like(instant.q)
        for k, motion in enumerate(self.motions):
            along[:n] = motion
            steps = [step * length / np.abs(motion).max() for step in STEPS]
            stored[k] = -motion @ change.of(along, np.zeros_like(along), steps)[:n]
        return stored


def modes(about: SceneSource | Simulation | Equilibrium, *, count: int = 20) -> VibrationModes:
    """The `count` lowest modes about the position of rest of a scene, or about a position of rest
    that was found, or about the present position of a simulation, which must be one.

    Of up to 1200 coordinates all modes are computed by dense matrices, of more the lowest ones by
    shift-invert Lanczos.

    Raises InputError where the mechanism is not at rest or singular, where a free motion has no
    mass, and what `equilibrium` raises.
    """
    rest = about if isinstance(about, Equilibrium) else equilibrium(about)
    count = whole(count, 'count', 1)
    if not rest.has_stiffness and rest.sample.model.n <= DENSE:
        raise InputError('no modes are told', key='modes', value='; '.join(rest.notes))
    loads = Loads(rest.simulation)
    instant = Instant(loads, rest.t, rest.state.q, np.zeros_like(rest.state.q), rest.state.turns)
    _, lam = pushed(instant, ConstrainedSolve(instant.model, loads.tangents.cliques))
    if instant.model.n > DENSE:
        squares, motions = lowest(instant, lam, count)
        return VibrationModes(instant, lam, squares, motions, motions)
    found = reduced_modes(reduced_stiffness(instant, lam))
    parts = (found.squares, found.motions, found.partners)
    return VibrationModes(instant, lam, *(part[:count] for part in parts))
