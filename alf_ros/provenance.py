"""What a run was computed with: versions of everything that may change a digit."""

from __future__ import annotations

import platform
from importlib import metadata

from alf_ros.resources import version

_PACKAGES = ('numpy', 'numba', 'llvmlite', 'scipy', 'rclpy')


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries, the processor and the platform."""
    found = {'alf_ros': version(), 'python': platform.python_version()}
    for package in _PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = 'unknown'
    return {**found, 'cpu': _cpu(), 'platform': platform.platform()}


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
