"""Labels of simulated photographs: exact, and checked against pictures drawn another way."""

import numpy as np
import pytest

from punnet.geometry import invert_transform, project, transform_points
from punnet.scene import KEYPOINTS, Visibility
from punnet.sim.gl_context import make_gl_context
from punnet.sim.labelled_views import VIEWS, draw_pose, label_berries, photograph
from punnet.sim.protocols import NIGHT
from punnet.sim.rendering import CameraRenderer
from punnet.sim.still_scene import PHOTO_CAMERA, PHOTO_INTRINSICS, build_still_scene
from punnet.sim.truth import shown_berries, silhouette, true_keypoints, true_picking_points

rasteriser = pytest.importorskip("faster_coco_eval.core.mask")
NAME = KEYPOINTS.index


@pytest.fixture(scope="module")
def context():
    gl = make_gl_context(PHOTO_INTRINSICS.width, PHOTO_INTRINSICS.height)
    yield gl
    gl.free()


class Shot:
    """One scene and one view of it."""

    def __init__(self, context, seed, view="middle"):
        rng = np.random.default_rng([77, seed])
        self.scene = build_still_scene(rng)
        self.T = draw_pose(self.scene, rng, view, 0)
        self.scene.place_camera(self.T)
        with CameraRenderer(self.scene.model, 640, 480, shared_context=context) as renderer:
            self.depth, self.segmentation = renderer.render_geometry(self.scene.data, PHOTO_CAMERA)
        self.labels = label_berries(self.scene, self.T, self.segmentation)


@pytest.fixture(scope="module")
def shots(context):
    return [Shot(context, seed, view) for seed, view in enumerate(("far", "middle", "near", "middle"))]


def test_the_camera_stands_where_its_pose_says(shots):
    for shot in shots:
        T = invert_transform(shot.T)
        checked = 0
        for index, berry in enumerate(shot.scene.cluster.berries):
            skin = shown_berries(shot.scene, shot.segmentation) == index
            points = transform_points(T, transform_points(berry.T_base_berry, berry.berry.mesh.vertices))
            u, v = np.rint(project(PHOTO_INTRINSICS, points)).astype(int).T
            inside = (u >= 0) & (u < 640) & (v >= 0) & (v < 480)
            u, v, z = u[inside], v[inside], points[inside, 2]
            front = skin[v, u] & (np.abs(shot.depth[v, u] - z) < 0.003)
            checked += int(front.sum())
        assert checked > 100


def test_masks_boxes_and_areas_agree(shots):
    assert sum(len(shot.labels) for shot in shots) > 8
    for shot in shots:
        masks = np.array([rasteriser.decode(label["segmentation"]) for label in shot.labels])
        assert masks.sum(axis=0).max() == 1
        for label, mask in zip(shot.labels, masks, strict=True):
            assert label["area"] == mask.sum() >= 30
            left, top, width, height = label["bbox"]
            v, u = np.nonzero(mask)
            points = np.array(label["keypoints"]).reshape(5, 3)
            points = points[points[:, 2] > 0, :2]
            for x, y in ((u.min(), v.min()), (u.max(), v.max()), *points):
                assert left - 0.02 <= x <= left + width + 0.02
                assert top - 0.02 <= y <= top + height + 0.02


def test_occlusion_is_what_drawing_the_berry_alone_says(context, shots):
    compared = 0
    for shot in shots[:2]:
        model = shot.scene.model
        groups = model.geom_group.copy()
        for label in shot.labels[:4]:
            index = label["berry_id"]
            own = model.geom(f"berry{index}_skin").id
            model.geom_group[:] = 5
            model.geom_group[own] = 0
            with CameraRenderer(model, 640, 480, shared_context=context) as renderer:
                _, alone = renderer.render_geometry(shot.scene.data, PHOTO_CAMERA)
            model.geom_group[:] = groups
            drawn = alone == own
            outline = silhouette(shot.scene, index, PHOTO_INTRINSICS, shot.T)
            assert (outline & drawn).sum() / (outline | drawn).sum() > 0.95
            bodies = np.append(model.geom_bodyid, -1)[shot.segmentation]
            hidden = drawn & (bodies != model.geom_bodyid[own])
            assert label["occlusion"] == pytest.approx(hidden.sum() / drawn.sum(), abs=0.04)
            compared += 1
    assert compared >= 4


def test_crowd_is_what_hardly_shows(shots):
    for shot in shots:
        for label in shot.labels:
            assert label["iscrowd"] == int(label["area"] < 100 or label["occlusion"] > 0.8)


def test_visibility_agrees_with_the_depth_picture(shots):
    # the labels come from rays; the depth picture is drawn. They may differ where a thing ends within a pixel.
    agreeing = total = hidden = 0
    for shot in shots:
        bodies = np.append(shot.scene.model.geom_bodyid, -1)[shot.segmentation]
        for label in shot.labels:
            own = shot.scene.model.body(f"berry{label['berry_id']}").id
            triples = np.array(label["keypoints"]).reshape(5, 3)
            for which, code in enumerate(label["visibility_detail"]):
                if code == Visibility.ABSENT:
                    assert triples[which, 2] == 0
                    assert label["keypoint_depths_m"][which] is None
                    continue
                u, v = np.rint(triples[which, :2]).astype(int)
                before = shot.depth[v, u] < label["keypoint_depths_m"][which] - 0.004
                foreign = bool(before and bodies[v, u] != own)
                total += 1
                hidden += foreign
                agreeing += foreign == (code == Visibility.HIDDEN_BY_OTHER)
    assert total > 40
    assert agreeing / total > 0.95
    assert 0 < hidden < total / 2


def test_top_hides_behind_the_fruit_from_below_and_bottom_from_above(shots):
    scene = shots[0].scene
    upright = min(range(scene.berries), key=lambda i: -scene.cluster.berries[i].T_base_berry[2, 2])
    hanging = scene.cluster.berries[upright]
    codes = {}
    for side in (-1.0, 1.0):
        T = np.eye(4)
        back = np.array((-0.5, 0.0, side * 0.866))
        right = np.cross(-back, (0.0, 0.0, 1.0)) / 0.5
        T[:3, :3] = np.stack((right, np.cross(-back, right), -back), axis=1)
        T[:3, 3] = hanging.centre + 0.12 * back
        codes[side] = true_keypoints(scene, PHOTO_INTRINSICS, T, np.array([upright])).visibility[0]
    assert codes[-1.0][NAME("top")] != Visibility.VISIBLE
    assert codes[1.0][NAME("bottom")] != Visibility.VISIBLE
    assert codes[-1.0][NAME("bottom")] in (Visibility.VISIBLE, Visibility.HIDDEN_BY_OTHER)


def test_depths_of_keypoints_lead_back_to_the_points(shots):
    shot = shots[1]
    picking = true_picking_points(shot.scene)
    for label in shot.labels:
        depth = label["keypoint_depths_m"][NAME("picking_point")]
        if depth is not None:
            in_camera = transform_points(invert_transform(shot.T), picking[label["berry_id"]][None])[0]
            assert depth == pytest.approx(in_camera[2], abs=1e-4)


def test_three_views_from_the_robots_side_nearer_and_nearer(context):
    rng = np.random.default_rng([78, 1])
    scene = build_still_scene(rng)
    with CameraRenderer(scene.model, 640, 480, shared_context=context) as renderer:
        views = list(photograph(scene, renderer, rng))
    assert [view.view for view in views] == list(VIEWS)
    centres = np.array([berry.centre for berry in scene.cluster.berries])
    for view in views:
        assert view.T_base_camera[0, 3] < centres[:, 0].min()  # in front of the plant
        assert view.rgb.shape == (480, 640, 3)
        assert view.depth.dtype == np.float32
        assert (view.depth > 0).mean() > 0.3
    nearest = [np.linalg.norm(centres - v.T_base_camera[:3, 3], axis=1).min() for v in views]
    assert nearest[0] > nearest[2]


def test_scenes_have_one_to_twelve_berries_and_all_their_kinds_of_surroundings():
    scenes = [build_still_scene(np.random.default_rng([79, seed])) for seed in range(8)]
    assert all(1 <= scene.berries <= 12 for scene in scenes)
    assert len({scene.setting for scene in scenes}) >= 3
    assert len({scene.berries for scene in scenes}) >= 4


def test_at_night_the_lamp_goes_with_the_camera(context):
    rng = np.random.default_rng(8)
    scene = build_still_scene(rng, NIGHT)
    with CameraRenderer(scene.model, 640, 480, shared_context=context) as renderer:
        for view in VIEWS:
            scene.place_camera(draw_pose(scene, rng, view, 0))
            rgb = renderer.render_rgb(scene.data, PHOTO_CAMERA).astype(float)
            _, segmentation = renderer.render_geometry(scene.data, PHOTO_CAMERA)
            fruit = shown_berries(scene, segmentation) >= 0
            assert fruit.sum() > 200
            assert (
                rgb[fruit].mean() > 60
            )  # the lamp shines on what the camera looks at, from wherever it looks
