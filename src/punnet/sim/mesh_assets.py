"""From our meshes and textures to MuJoCo assets."""

from __future__ import annotations

from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError
from punnet.sim.mesh import Mesh

__all__ = ["MeshAsset", "add_mesh_asset", "add_texture_asset", "smooth_normals"]

_WELD_DECIMALS = 6  # a micrometre: seams meet exactly, the two sides of a leaf lie further apart


class MeshAsset(NamedTuple):
    """Names to give a geom: ``geom.meshname = asset.mesh``, ``geom.material = asset.material``."""

    mesh: str
    material: str


def smooth_normals(mesh: Mesh) -> NDArray[np.float64]:
    """Compute unit vertex normals (V, 3), area-weighted, the same on both sides of a texture seam."""
    corners = mesh.vertices[mesh.faces]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    _, group = np.unique(np.round(mesh.vertices, _WELD_DECIMALS), axis=0, return_inverse=True)
    group = group.reshape(-1)
    summed = np.zeros((int(group.max()) + 1, 3))
    for corner in range(3):
        np.add.at(summed, group[mesh.faces[:, corner]], face_normals)
    normals = summed[group]
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    up = np.broadcast_to((0.0, 0.0, 1.0), normals.shape)
    return np.asarray(np.where(lengths > 0, normals / np.maximum(lengths, 1e-30), up))


def add_texture_asset(spec: mujoco.MjSpec, name: str, image: NDArray[np.uint8]) -> str:
    """Add an RGB image (H, W, 3) as a 2-D texture; texture coordinate (0, 0) is its first pixel.

    Raises
    ------
    ShapeError
        If the image is not uint8 (H, W, 3).
    """
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ShapeError(f"texture '{name}': need uint8 (H, W, 3), got {image.dtype} {image.shape}")
    texture = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=image.shape[1],
        height=image.shape[0],
        nchannel=3,
    )
    texture.data = np.ascontiguousarray(image).tobytes()
    return name


def _add_material(
    spec: mujoco.MjSpec,
    name: str,
    look: NDArray[np.uint8] | tuple[float, float, float, float],
    **gloss: float,
) -> str:
    """One material of a texture or of a plain colour."""
    if isinstance(look, tuple):
        spec.add_material(name=name, rgba=look, **gloss)
        return name
    textures = [""] * int(mujoco.mjtTextureRole.mjNTEXROLE)
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = add_texture_asset(spec, f"{name}_texture", look)
    spec.add_material(name=name, textures=textures, **gloss)
    return name


def add_mesh_asset(
    spec: mujoco.MjSpec,
    name: str,
    mesh: Mesh,
    look: NDArray[np.uint8] | tuple[float, float, float, float] | str,
    *,
    specular: float = 0.2,
    shininess: float = 0.3,
    emission: float = 0.0,
) -> MeshAsset:
    """Add ``mesh`` and its look to a MuJoCo specification.

    MuJoCo moves a mesh to its centre of mass at compile time and compensates in the geom's pose, so a
    geom made with this asset at the identity pose shows the mesh in its own frame.

    Parameters
    ----------
    spec
        The specification to add to.
    name
        Name of the mesh; a new material is called ``{name}_material``.
    mesh
        The mesh; thin sheets and open meshes are fine (mass properties are those of its shell).
    look
        A texture uint8 (H, W, 3), a colour RGBA in [0, 1], or the name of a material that exists.
    specular, shininess, emission
        As in MuJoCo's materials, in [0, 1]; unused when ``look`` names a material.

    Returns
    -------
    MeshAsset
        Names of the mesh and of the material.
    """
    fields: dict[str, Any] = {}
    if mesh.uv is not None:
        fields["usertexcoord"] = mesh.uv.astype(np.float32).ravel()
        fields["userfacetexcoord"] = mesh.faces.astype(np.int32).ravel()
    asset = spec.add_mesh(
        name=name,
        uservert=mesh.vertices.astype(np.float32).ravel(),
        userface=mesh.faces.astype(np.int32).ravel(),
        usernormal=smooth_normals(mesh).astype(np.float32).ravel(),
        userfacenormal=mesh.faces.astype(np.int32).ravel(),
        **fields,
    )
    asset.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    gloss = {"specular": specular, "shininess": shininess, "emission": emission}
    material = look if isinstance(look, str) else _add_material(spec, f"{name}_material", look, **gloss)
    return MeshAsset(name, material)
