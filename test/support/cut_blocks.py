"""From the blocks of a mechanism to those where each body has its own."""

from __future__ import annotations

from alf_ros.arrays import Floats
from alf_ros.simulation.reactions import Reactions


def on_cut_blocks(reactions: Reactions, blocks: Floats) -> Floats:
    """(blocks D,) of the mechanism -> (cut blocks D,)."""
    return blocks.reshape(-1, reactions.cut.dimension)[reactions.source].ravel()
