"""Coverage of the processes that tests start: only of those that ask for it.

To trace a process doubles the time of its Python, and those that compile take long enough.
"""

from __future__ import annotations

import os

_NAME = 'COVERAGE_PROCESS_CONFIG'
_config = ''


def leave_children_alone() -> None:
    """Processes that this one starts are no longer traced."""
    global _config
    _config = os.environ.pop(_NAME, _config)


def traced() -> dict[str, str]:
    """The environment with which a process is traced, if this one is."""
    return {_NAME: _config} if _config else {}
