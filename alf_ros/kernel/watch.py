"""What is noted at the end of each step while somebody watches for singular positions."""

from __future__ import annotations

from alf_ros.arrays import Unit
from alf_ros.kernel.data import Forces, System, Watch, Work
from alf_ros.kernel.forces import potential_energy
from alf_ros.kernel.jit import inner
from alf_ros.kernel.mass import add_mass_times
from alf_ros.kernel.trace import mass_trace
from alf_ros.kernel.vectors import zero


@inner
def note(
    unit: Unit,
    system: System,
    forces: Forces,
    work: Work,
    watch: Watch,
    taken: int,
    t: float,
) -> None:
    """tr(M A⁻¹) and the energy at the end of step `taken`, at t, from what is in `work`."""
    watch.trace[taken] = mass_trace(
        unit, system.pattern, work.diagonal, work.off, work.column, watch.Z, watch.Zo
    )
    zero(work.p)
    add_mass_times(unit, system.mass, 0.5, work.qd, work.p)
    energy = potential_energy(forces.effects, t, work.q, work.near)
    for i in range(work.p.size):
        energy += work.p[i] * work.qd[i]
    watch.energy[taken] = energy
