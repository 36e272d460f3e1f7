"""A platform on three parallel cranks, one row too many: no rigid body says how the cranks share
the load along them."""

from __future__ import annotations

THREE_CRANKS = """
mechanism:
  alf: 1
  space: planar
  points:
    A<k>: {for: {k: [0, 2]}, at: [k, 0], fixed: true}
    B<k>: {for: {k: [0, 2]}, at: [k, 1]}
  bodies:
    crank<k>: {for: {k: [0, 2]}, points: [A<k>, B<k>], mass: 0.5, inertia: rod}
    platform: {points: [B0, B1, B2], mass: 2, com: [1, 0], inertia: {about_com: 0.4}}
  joints:
    foot<k>: {for: {k: [0, 2]}, type: revolute, between: [ground, crank<k>], at: A<k>}
    head<k>: {for: {k: [0, 2]}, type: revolute, between: [crank<k>, platform], at: B<k>}
effects: {gravity: {acceleration: [0, -9.81]}}
initial: {velocities: {B0: [2, 0]}}
solver: {step: 1.0e-3, integrator: rk4}
"""
