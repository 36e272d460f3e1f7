"""Logs without ROS: `load` one, examine it, run it again.

log = load('logs/slider_crank_20260101T000000Z')
log.scene_text, log.versions, log.inputs      # scene, software, commands
log.states.t, log.states.q                    # (N,), (N, n)
log.read('joint_states').columns['position']  # (N, joints)
for piece in log.pieces(['joint_states']):    # a log of any length, chunk by chunk
    ...
"""

from __future__ import annotations

from alf_ros.logs.log import Log, States, load
from alf_ros.logs.series import Series

__all__ = ['Log', 'Series', 'States', 'load']
