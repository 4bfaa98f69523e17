"""Scenery and mesh assets: what MuJoCo makes of them, and what a camera sees."""

import mujoco
import numpy as np
import pytest

from punnet.errors import ShapeError
from punnet.sim.berry import make_berry
from punnet.sim.calyx import calyx_texture, make_calyx
from punnet.sim.layers import COLLISION_ONLY
from punnet.sim.mesh import Mesh
from punnet.sim.mesh_assets import add_mesh_asset, add_texture_asset, smooth_normals
from punnet.sim.noise import tiling_noise
from punnet.sim.ripeness import RipenessStage
from punnet.sim.scenery import SceneryLayout, add_scenery


@pytest.fixture(scope="module")
def tunnel():
    spec = mujoco.MjSpec()
    add_scenery(spec, np.random.default_rng(1))
    return spec.compile()


def test_only_the_structure_is_solid(tunnel):
    solid = {
        tunnel.geom(g).name
        for g in range(tunnel.ngeom)
        if tunnel.geom_contype[g] or tunnel.geom_conaffinity[g]
    }
    assert solid == {"gutter", "bags", "leg0", "leg1", "leg2", "ground"}
    assert tunnel.geom("bags").group[0] == COLLISION_ONLY


def test_gutter_stands_where_the_layout_says(tunnel):
    layout = SceneryLayout()
    gutter = tunnel.geom("gutter")
    assert gutter.pos[0] - gutter.size[0] == pytest.approx(layout.front)
    assert gutter.pos[2] - gutter.size[2] == pytest.approx(layout.bottom)
    assert gutter.pos[2] + gutter.size[2] == pytest.approx(layout.lip)


def test_background_is_cheap(tunnel):
    meshes = [g for g in range(tunnel.ngeom) if tunnel.geom_type[g] == mujoco.mjtGeom.mjGEOM_MESH]
    assert sum(tunnel.mesh_facenum[tunnel.geom_dataid[g]] for g in meshes) < 12_000
    assert tunnel.nlight == 3
    assert tunnel.light_castshadow.sum() == 1


def test_seeds_change_the_scene():
    pictures = []
    for seed in (1, 1, 2):
        spec = mujoco.MjSpec()
        add_scenery(spec, np.random.default_rng(seed))
        model = spec.compile()
        pictures.append((model.geom("leg1").pos.copy(), model.tex_data.copy()))
    np.testing.assert_array_equal(pictures[0][0], pictures[1][0])
    np.testing.assert_array_equal(pictures[0][1], pictures[1][1])
    assert not np.allclose(pictures[0][0], pictures[2][0])


def test_mesh_asset_keeps_its_own_frame():
    """The compiler recentres meshes; a geom at the identity must still show a berry in its own frame."""
    rng = np.random.default_rng(0)
    berry = make_berry(rng, RipenessStage.RIPE)
    calyx = make_calyx(rng, berry.width)
    spec = mujoco.MjSpec()
    skin = add_mesh_asset(spec, "skin", berry.mesh, berry.texture, specular=0.5)
    green = add_mesh_asset(spec, "calyx", calyx, calyx_texture(rng))
    again = add_mesh_asset(spec, "calyx_too", calyx, green.material)
    assert again.material == green.material
    for mesh, material in (skin, green):
        spec.worldbody.add_geom(
            name=mesh,
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname=mesh,
            material=material,
            contype=0,
            conaffinity=0,
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, source in (("skin", berry.mesh), ("calyx", calyx)):
        number = model.mesh(name).id
        first, count = model.mesh_vertadr[number], model.mesh_vertnum[number]
        geom = model.geom(name).id
        shown = (
            model.mesh_vert[first : first + count] @ data.geom_xmat[geom].reshape(3, 3).T
            + data.geom_xpos[geom]
        )
        np.testing.assert_allclose(shown.min(axis=0), source.vertices.min(axis=0), atol=2e-6)
        np.testing.assert_allclose(shown.max(axis=0), source.vertices.max(axis=0), atol=2e-6)


def test_texture_of_the_wrong_kind_is_refused():
    with pytest.raises(ShapeError, match="texture 'x'"):
        add_texture_asset(mujoco.MjSpec(), "x", np.zeros((4, 4), dtype=np.uint8))


def test_normals_are_smooth_over_a_seam():
    berry = make_berry(np.random.default_rng(0), RipenessStage.RIPE)
    normals = smooth_normals(berry.mesh)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    _, group = np.unique(np.round(berry.mesh.vertices, 6), axis=0, return_inverse=True)
    for place in np.unique(group)[:200]:
        same = normals[group.reshape(-1) == place]
        np.testing.assert_allclose(same, np.broadcast_to(same[0], same.shape), atol=1e-12)
    outward = berry.mesh.vertices - berry.centre
    assert (np.einsum("ij,ij->i", normals, outward) > 0).mean() > 0.95


def test_normals_of_the_two_sides_of_a_sheet_stay_apart():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    sheet = Mesh.joined([Mesh(square, faces), Mesh(square - (0, 0, 0.0003), faces[:, ::-1])])
    np.testing.assert_allclose(smooth_normals(sheet)[:, 2], [1, 1, 1, 1, -1, -1, -1, -1])


@pytest.mark.parametrize("sigma", [1.0, 4.0, 20.0])
def test_noise_tiles_and_is_normalised(sigma):
    field = tiling_noise(np.random.default_rng(0), (128, 256), sigma)
    assert field.shape == (128, 256)
    assert field.mean() == pytest.approx(0.0, abs=1e-3)
    assert field.std() == pytest.approx(1.0, abs=1e-3)
    steps = np.abs(np.diff(field, axis=1)).mean()
    assert np.abs(field[:, 0] - field[:, -1]).mean() < 2.5 * steps
    assert np.abs(field[0] - field[-1]).mean() < 2.5 * np.abs(np.diff(field, axis=0)).mean()
