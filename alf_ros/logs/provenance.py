"""Software and machine of a run: versions of everything that may change a digit."""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Mapping
from dataclasses import asdict
from functools import cache
from importlib import metadata
from typing import Any

from llvmlite import binding

from alf_ros import effects
from alf_ros.effects.contract import user_file
from alf_ros.resources import version
from alf_ros.scene.scene import Scene
from alf_ros.simulation.setup import Setup

_PACKAGES = ('numpy', 'numba', 'llvmlite', 'scipy', 'rclpy')


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries, the processor and the platform.

    They are read once in a process: imported packages stay, also if another version is installed
    later. A reset of the node thus does not wait 20 ms for them.
    """
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
    found = {'alf_ros': version(), 'python': platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = 'unknown'
    return {**found, **_compiler(), 'cpu': _cpu(), 'platform': platform.platform()}


def about() -> str:
    """The processor and the versions that results of this machine depend on, as a comment line."""
    libraries = ', '.join(
        f'{name} {metadata.version(name)}' for name in ('numpy', 'scipy', 'numba')
    )
    python = platform.python_version()
    return f'# {_cpu()}, Python {python}, {libraries}, {time.strftime("%Y-%m-%d")}'


def start(setup: Setup, ahead: int, topics: Mapping[str, str]) -> dict[str, Any]:
    """Description of a run in a log, without the scene's text: stamps are `ahead` (ns) of the
    simulated time; where `topics` are, by the names users write."""
    scene, simulation = setup.scene, setup.simulation
    return {
        'scene': scene.name,
        'scene_sha256': scene.hash,
        'solver': asdict(simulation.solver),
        'ledger': simulation.ledger,
        'steps_per_tick': setup.steps,
        'stamps_ahead_ns': ahead,
        'topics': dict(topics),
        **_of_effects(scene),
        'versions': versions(),
    }


def record(about: Mapping[str, Any], scene: Scene) -> dict[str, str]:
    """The same as texts, with the scene's: the Metadata record of a log."""
    texts = {k: v if isinstance(v, str) else json.dumps(v) for k, v in about.items()}
    return {**texts, 'scene_text': scene.text}


def _of_effects(scene: Scene) -> dict[str, Any]:
    """Parts of a scene outside its text: `files`, the texts of effects that are files (by full
    name), and `effects`, their `foreign_code`."""
    files = user_file.sources(effect.kind for effect in scene.effects)
    return {'files': files, 'effects': foreign_code(scene)}


def foreign_code(scene: Scene) -> dict[str, str]:
    """`effects.foreign_code` of a scene."""
    return effects.foreign_code(effect.kind for effect in scene.effects)


def _compiler() -> dict[str, str]:
    """LLVM, and the processor as it knows it: what instructions the compiled code may have."""
    llvm = '.'.join(map(str, binding.llvm_version_info))
    return {'llvm': llvm, 'llvm_cpu': binding.get_host_cpu_name()}


def _cpu() -> str:
    """Model of the processor; Linux says it in /proc, elsewhere the machine type has to do."""
    try:
        with open('/proc/cpuinfo', encoding='utf-8') as info:
            for line in info:
                if line.startswith('model name'):
                    return line.partition(':')[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
