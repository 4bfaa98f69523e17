"""Who touches whom, and what is drawn where: contact bits and geometry groups of the world.

A contact pair is computed only if one's ``contype`` meets the other's ``conaffinity``. The tool touches everything
of the plant and the structure; berries also touch each other and the structure; stems and leaves touch only the tool.
"""

from __future__ import annotations

__all__ = [
    "ARM_VISUAL",
    "BERRY",
    "COLLISION_ONLY",
    "PLANT_VISUAL",
    "SCENERY",
    "SOFT_PLANT",
    "STRUCTURE",
    "TOUCHES_NOTHING",
    "TOUCHES_PLANT_AND_STRUCTURE",
    "TOUCHES_STRUCTURE",
]

_TOOL_BIT, _BERRY_BIT, _ARM_BIT = 1, 2, 4

TOUCHES_NOTHING = (0, 0)
TOUCHES_PLANT_AND_STRUCTURE = (_TOOL_BIT, 0)
TOUCHES_STRUCTURE = (_ARM_BIT, 0)
BERRY = (_BERRY_BIT, _TOOL_BIT | _BERRY_BIT)
SOFT_PLANT = (0, _TOOL_BIT)
STRUCTURE = (0, _TOOL_BIT | _BERRY_BIT | _ARM_BIT)

# Geometry groups: the wrist camera draws 0 and 1, the third-person view also 2; 3 is never drawn.
SCENERY, PLANT_VISUAL, ARM_VISUAL, COLLISION_ONLY = 0, 1, 2, 3
