"""The `<surface>` of a collision of an SDF, and coefficients of friction as Gazebo has them."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree

from alf_ros.exchange.sdf_values import Refuse, number, numbers, says

_EVERY = ('65535', '0xffff', '0xFFFF')  # the mask of what meets all others, the default


@dataclass(frozen=True)
class CollisionSurface:
    """friction: coefficient along a direction; `across` it, None if both are alike. left_out: what
    else it has, by the kinds of `import_report`."""

    friction: float
    across: float | None
    left_out: tuple[str, ...]


def read(collision: ElementTree.Element, refuse: Refuse, key: str) -> CollisionSurface:
    """Of a collision. Raises the error for numbers that cannot be used."""
    ode = collision.find('surface/friction/ode')
    mu, mu2 = (None if ode is None else ode.find(tag) for tag in ('mu', 'mu2'))
    friction, across = coefficients(mu, mu2, refuse, key)
    found = {
        'filters of contact': _is_filtered(collision, refuse, key),
        'friction of contact': _resists_turning(collision, refuse, key),
        'slip of contact': any(number(ode, tag, 0.0, refuse, key) for tag in ('slip1', 'slip2')),
        'friction of Bullet': _is_other(collision, (friction, across), refuse, key),
    }
    return CollisionSurface(
        friction, across, tuple(kind for kind, is_so in found.items() if is_so)
    )


def coefficients(
    mu: ElementTree.Element | None, mu2: ElementTree.Element | None, refuse: Refuse, key: str
) -> tuple[float, float | None]:
    """Of friction along a direction and across it, 1 where one is absent: None for the second if
    both are alike. Raises the error."""
    along, across = (_coefficient(each, refuse, key) for each in (mu, mu2))
    return along, None if across == along else across


def _coefficient(element: ElementTree.Element | None, refuse: Refuse, key: str) -> float:
    if element is None or not (element.text or '').strip():
        return 1.0
    x = float(numbers(element.text or '', 1, refuse, key, element)[0])
    if x < 0.0:
        raise refuse(key, f'negative {element.tag}', at=element, value=x, expected='0 or more')
    return x


def _is_filtered(collision: ElementTree.Element, refuse: Refuse, key: str) -> bool:
    """Whether something passes through it."""
    contact = collision.find('surface/contact')
    if contact is None:
        return False
    mask = (contact.findtext('collide_bitmask') or '').strip()
    without = says(contact, 'collide_without_contact', refuse, key)
    return without or mask not in ('', *_EVERY)


def _resists_turning(collision: ElementTree.Element, refuse: Refuse, key: str) -> bool:
    """Whether friction acts on its spin or its roll. The patch that touches has no size unless the
    file states one."""
    bullet = collision.find('surface/friction/bullet')
    if number(bullet, 'rolling_friction', 0.0, refuse, key):
        return True
    torsional = collision.find('surface/friction/torsional')
    by_patch = says(torsional, 'use_patch_radius', refuse, key, default=True)
    size = number(torsional, 'patch_radius' if by_patch else 'surface_radius', 0.0, refuse, key)
    coefficient = number(torsional, 'coefficient', 1.0, refuse, key)
    return bool(size and coefficient)


def _is_other(
    collision: ElementTree.Element,
    ode: tuple[float, float | None],
    refuse: Refuse,
    key: str,
) -> bool:
    """Whether Bullet has other coefficients than ODE."""
    bullet = collision.find('surface/friction/bullet')
    if bullet is None:
        return False
    own = coefficients(bullet.find('friction'), bullet.find('friction2'), refuse, key)
    return own != ode
