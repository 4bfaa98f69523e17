"""How shiny things are: keyword arguments for :func:`punnet.sim.mesh_assets.add_mesh_asset` and materials."""

from __future__ import annotations

from typing import Final

__all__ = ["BERRY_GLOSS", "CALYX_GLOSS", "FLOWER_GLOSS", "LEAF_GLOSS", "STEM_GLOSS"]

# A berry's skin is waxy: a broad, bright reflection of the tunnel's sheet. Small sparkles are in its texture.
BERRY_GLOSS: Final = {"specular": 0.75, "shininess": 0.25}
CALYX_GLOSS: Final = {"specular": 0.12, "shininess": 0.1}
FLOWER_GLOSS: Final = {"specular": 0.0, "shininess": 0.0}
LEAF_GLOSS: Final = {"specular": 0.22, "shininess": 0.2}
STEM_GLOSS: Final = {"specular": 0.15, "shininess": 0.2}
