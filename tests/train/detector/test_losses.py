"""The terms of Eq. 3.1 and ours, above all where nothing is known or nothing is there."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="TRAINING NOT INSTALLED: pip install 'punnet[train]'")

from torch import Tensor  # noqa: E402

from punnet.train.detector.augmentation import Labels  # noqa: E402
from punnet.train.detector.heads import ripeness_loss, visibility_loss  # noqa: E402
from punnet.train.detector.network import BerryDetector  # noqa: E402
from punnet.train.detector.regions import enlarged  # noqa: E402
from punnet.train.detector.samples import to_targets  # noqa: E402
from tests.train.detector.berries import small_config  # noqa: E402

TERMS = {
    "objectness",
    "proposal_box",
    "classes",
    "box",
    "mask",
    "keypoint",
    "visibility",
    "ripeness",
}
CROP = (64, 96)


def labels(berries: int = 1, **changes: Any) -> Labels:
    """Berries side by side with all that can be known."""
    boxes = np.array([[10.0 + 40 * k, 12.0, 34.0 + 40 * k, 50.0] for k in range(berries)]).reshape(-1, 4)
    masks = np.zeros((berries, *CROP), np.uint8)
    for k in range(berries):
        masks[k, 18:50, 10 + 40 * k : 34 + 40 * k] = 1
    points = np.array([[(22, 13), (22, 18), (22, 49), (11, 34), (33, 34)]] * berries, dtype=np.float64)
    points = points.reshape(berries, 5, 2) + np.arange(berries).reshape(-1, 1, 1) * (40, 0)
    values: dict[str, Any] = {
        "boxes": boxes,
        "classes": np.arange(berries) % 2,
        "masks": masks,
        "has_mask": np.ones(berries, dtype=np.bool_),
        "keypoints": points,
        "allowed": np.tile(np.arange(4) == 2, (berries, 5, 1)),
        "ripeness": np.full(berries, 0.7),
        "ignored": np.zeros((0, 4)),
    }
    return Labels(**{**values, **changes})


@pytest.fixture(scope="module")
def network() -> BerryDetector:
    torch.manual_seed(0)
    return BerryDetector(small_config()).train()


@pytest.fixture(scope="module")
def image() -> Tensor:
    return torch.from_numpy(np.random.default_rng(0).uniform(0, 255, (1, 3, *CROP)).astype(np.float32))


def losses_of(network: BerryDetector, image: Tensor, *targets: Labels) -> dict[str, Tensor]:
    """Losses with the gradients in place."""
    network.zero_grad()
    torch.manual_seed(1)
    losses = network(image.expand(len(targets), -1, -1, -1), [to_targets(t) for t in targets])
    torch.stack(list(losses.values())).sum().backward()
    return dict(losses)


def gradient(module: torch.nn.Module) -> float:
    """Largest gradient of a module; every parameter has one, which is what training on many processes needs."""
    values = [p.grad for p in module.parameters() if p.requires_grad]
    assert all(value is not None and value.isfinite().all() for value in values)
    return max(float(value.abs().max()) for value in values if value is not None)


def test_every_term_is_there_and_trains_its_head(network: BerryDetector, image: Tensor) -> None:
    losses = losses_of(network, image, labels(2))
    assert losses.keys() == TERMS
    assert all(float(value.detach()) > 0 for value in losses.values())
    for module in (network.trunk, network.proposals, *network.heads.children()):
        if any(True for _ in module.parameters()):
            assert gradient(module) > 0


def test_boxes_alone_train(network: BerryDetector, image: Tensor) -> None:
    nothing = labels(
        has_mask=np.array([False]),
        masks=np.zeros((1, *CROP), np.uint8),
        keypoints=np.full((1, 5, 2), np.nan),
        allowed=np.ones((1, 5, 4), dtype=np.bool_),
        ripeness=np.array([np.nan]),
    )
    losses = losses_of(network, image, nothing)
    for name in ("mask", "keypoint", "visibility", "ripeness"):
        assert float(losses[name].detach()) == 0, name
    for head in (network.heads.mask_head, network.heads.keypoint_head, network.heads.attribute_head):
        assert gradient(head) == 0
    assert gradient(network.heads.box_head) > 0


def test_masks_without_keypoints_train_masks(network: BerryDetector, image: Tensor) -> None:
    partial = labels(
        keypoints=np.full((1, 5, 2), np.nan),
        allowed=np.ones((1, 5, 4), dtype=np.bool_),
        ripeness=np.array([np.nan]),
    )
    losses = losses_of(network, image, partial)
    assert float(losses["mask"].detach()) > 0
    assert float(losses["keypoint"].detach()) == float(losses["visibility"].detach()) == 0
    assert gradient(network.heads.mask_head) > 0
    assert gradient(network.heads.keypoint_head) == 0


def test_partial_and_whole_labels_in_one_batch_count_only_what_is_known(
    network: BerryDetector, image: Tensor
) -> None:
    whole = labels()
    bare = labels(
        has_mask=np.array([False]),
        masks=np.zeros((1, *CROP), np.uint8),
        keypoints=np.full((1, 5, 2), np.nan),
        allowed=np.ones((1, 5, 4), dtype=np.bool_),
        ripeness=np.array([np.nan]),
    )
    losses = losses_of(network, image, whole, bare)
    assert all(float(value.detach()) > 0 for value in losses.values())


def test_images_without_berries_train(network: BerryDetector, image: Tensor) -> None:
    losses = losses_of(network, image, labels(0), labels(0))
    assert all(bool(value.isfinite()) for value in losses.values())
    assert float(losses["classes"].detach()) > 0
    assert float(losses["mask"].detach()) == float(losses["box"].detach()) == 0
    gradient(network)


def test_an_image_that_is_ignored_from_edge_to_edge_trains(network: BerryDetector, image: Tensor) -> None:
    losses = losses_of(network, image, labels(0, ignored=np.array([[0.0, 0.0, CROP[1], CROP[0]]])))
    assert all(bool(value.isfinite()) for value in losses.values())
    assert float(losses["classes"].detach()) == 0
    gradient(network)


def test_anchors_in_ignored_areas_teach_nothing(network: BerryDetector) -> None:
    inside = torch.tensor([[20.0, 20, 30, 40], [60, 5, 70, 15]])
    outside = torch.tensor([[70.0, 30, 90, 60], [25, 30, 48, 60]])  # the last lies less than half inside
    target = to_targets(labels(0, ignored=np.array([[18.0, 18.0, 34.0, 44.0], [58.0, 0.0, 75.0, 20.0]])))
    anchors = torch.cat((inside, outside))
    assigned, boxes = network.proposals.assign_targets_to_anchors([anchors], [target])
    assert assigned[0].tolist() == [-1, -1, 0, 0]
    logits = torch.zeros(4, 1, requires_grad=True)
    regression = network.proposals.box_coder.encode(boxes, [anchors])
    objectness, _ = network.proposals.compute_loss(logits, torch.zeros(4, 4), assigned, regression)
    objectness.backward()
    assert logits.grad is not None
    assert logits.grad[:2].abs().max() == 0
    assert (logits.grad[2:] > 0).all()


def test_a_berry_in_an_ignored_area_still_counts(network: BerryDetector) -> None:
    target = to_targets(labels(1, ignored=np.array([[0.0, 0.0, 60.0, 60.0]])))
    assigned, _ = network.proposals.assign_targets_to_anchors(
        [torch.tensor([[10.0, 12, 34, 50], [40, 5, 50, 15]])], [target]
    )
    assert assigned[0].tolist() == [1, -1]


def test_regions_in_ignored_areas_are_no_background(network: BerryDetector) -> None:
    ignored = np.array([[0.0, 0.0, 50.0, 64.0]])
    proposals = [torch.tensor([[5.0, 5, 40, 40], [60, 10, 90, 50], [2, 30, 30, 60]])]
    kept, _, classes, _ = network.heads.select_training_samples(
        proposals, [to_targets(labels(0, ignored=ignored))]
    )
    assert kept[0].tolist() == [[60, 10, 90, 50]]
    assert classes[0].tolist() == [0]


def test_visibility_is_the_log_of_what_is_allowed() -> None:
    torch.manual_seed(0)
    logits = torch.randn(3, 5, 4)
    allowed = torch.zeros(3, 5, 4, dtype=torch.bool)
    allowed[..., 2] = True
    allowed[1, 0] = torch.tensor([False, True, False, True])  # hidden, by what is not known
    allowed[2] = True  # nothing known: does not count
    probability = torch.softmax(logits, dim=-1)
    expected = -torch.log((probability * allowed).sum(-1))[:2].mean()
    assert float(visibility_loss(logits, allowed)) == pytest.approx(float(expected), abs=1e-6)
    alone = torch.zeros(1, 5, 4, dtype=torch.bool)
    alone[..., 2] = True
    assert float(visibility_loss(logits[:1], alone)) == pytest.approx(
        float(torch.nn.functional.cross_entropy(logits[0], torch.full((5,), 2))), abs=1e-6
    )


def test_nothing_known_is_no_loss_and_no_nan() -> None:
    logits = torch.randn(2, 5, 4, requires_grad=True)
    visibility_loss(logits, torch.ones(2, 5, 4, dtype=torch.bool)).backward()
    assert logits.grad is not None
    assert logits.grad.abs().max() == 0
    shares = torch.randn(2, requires_grad=True)
    ripeness_loss(shares, torch.full((2,), torch.nan)).backward()
    assert shares.grad is not None
    assert shares.grad.abs().max() == 0
    ripeness_loss(shares, torch.tensor([0.2, torch.nan])).backward()
    assert shares.grad[0] != 0
    assert shares.grad[1] == 0
    assert shares.grad.isfinite().all()


def test_regions_are_enlarged_about_their_centres() -> None:
    boxes = torch.tensor([[10.0, 20, 30, 60]])
    assert enlarged(boxes, 0.1)[0].tolist() == pytest.approx([9, 18, 31, 62])
    assert torch.equal(enlarged(boxes, 0.0), boxes)
