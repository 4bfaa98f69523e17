"""The detector: one trunk; boxes, classes, masks, key-points, visibility and ripeness from it (Fig. 3.6)."""

from __future__ import annotations

from typing import Any

from torch import Tensor, nn
from torchvision.models.detection.anchor_utils import AnchorGenerator
from torchvision.models.detection.faster_rcnn import FastRCNNPredictor, TwoMLPHead
from torchvision.models.detection.image_list import ImageList
from torchvision.models.detection.rpn import RPNHead
from torchvision.ops import MultiScaleRoIAlign

from punnet.scene import CLASSES
from punnet.train.detector.backbones import Trunk, build_trunk
from punnet.train.detector.config import DetectorConfig
from punnet.train.detector.heads import AttributeHead, KeypointHead, MaskHead
from punnet.train.detector.regions import BerryProposals, BerryRegionHeads

__all__ = ["LEAST_SCORE", "BerryDetector", "count_parameters"]

# Boxes hold the stem, so they are taller than wide.
ASPECT_RATIOS = (1.0, 1.8)
ANCHOR_SIZES = {
    "p2": (12.0, 20.0),
    "p3": (18.0, 32.0),
    "p4": (56.0, 96.0),
    "p5": (150.0, 240.0),
    "c4": (18.0, 32.0, 56.0, 96.0, 150.0, 240.0),
}
BOX_CELLS = 7
LEAST_SCORE = 0.05


class BerryDetector(nn.Module):
    """Network of a config. In training mode :meth:`forward` gives losses, else detections."""

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__()
        self.config = config
        self.trunk: Trunk = build_trunk(config)
        if config.pretrained:
            self.trunk.freeze_stem()
        levels = self.trunk.levels
        # The finest map is for outlines; anchors on it would cost more than all others together.
        coarse = levels[1:] if len(levels) > 1 else levels
        self.proposals = _proposals(config, self.trunk.channels, coarse)
        self.heads = _region_heads(config, self.trunk, coarse, levels[:1])

    def forward(self, images: Tensor, targets: list[dict[str, Tensor]] | None = None) -> Any:
        """Losses by term (training) or one dictionary of detections an image.

        Parameters
        ----------
        images
            (B, 3, H, W) float in 0…255; H and W multiples of 32.
        targets
            An image's ``boxes`` (N, 4), ``labels`` (N,) 1 or 2, ``masks`` (N, H, W), ``has_mask`` (N,),
            ``keypoints`` (N, 5, 3), ``visibility`` (N, 5, 4) allowed codes, ``ripeness`` (N,), ``ignored`` (K, 4).
        """
        sizes = [(images.shape[-2], images.shape[-1])] * images.shape[0]
        features = self.trunk(images)
        regions, proposal_losses = self.proposals(ImageList(images, sizes), features, targets)
        detections, losses = self.heads(features, regions, sizes, targets)
        if not self.training:
            return detections
        return {
            "objectness": proposal_losses["loss_objectness"],
            "proposal_box": proposal_losses["loss_rpn_box_reg"],
            **losses,
        }

    def train(self, mode: bool = True) -> BerryDetector:
        """Switch to training; batch statistics that come from ImageNet stay as they are."""
        super().train(mode)
        if mode and self.config.pretrained:
            for module in self.trunk.body.modules():
                if isinstance(module, nn.BatchNorm2d):
                    module.eval()
        return self


def _proposals(config: DetectorConfig, channels: int, levels: tuple[str, ...]) -> BerryProposals:
    anchors = AnchorGenerator(tuple(ANCHOR_SIZES[level] for level in levels), (ASPECT_RATIOS,) * len(levels))
    head = RPNHead(channels, anchors.num_anchors_per_location()[0])
    return BerryProposals(
        levels,
        anchors,
        head,
        fg_iou_thresh=0.6,
        bg_iou_thresh=0.3,
        batch_size_per_image=128,
        positive_fraction=0.5,
        pre_nms_top_n={"training": 2 * config.proposals_training, "testing": 3 * config.proposals},
        post_nms_top_n={"training": config.proposals_training, "testing": config.proposals},
        nms_thresh=0.7,
    )


def _region_heads(
    config: DetectorConfig, trunk: Trunk, levels: tuple[str, ...], outlined: tuple[str, ...]
) -> BerryRegionHeads:
    channels, cells = trunk.channels, 2 * config.region_size
    return BerryRegionHeads(
        MultiScaleRoIAlign(list(levels), BOX_CELLS, sampling_ratio=2),
        TwoMLPHead(channels * BOX_CELLS**2, config.box_units),
        FastRCNNPredictor(config.box_units, 1 + len(CLASSES)),
        fg_iou_thresh=0.5,
        bg_iou_thresh=0.5,
        batch_size_per_image=config.regions_an_image,
        positive_fraction=config.positive_share,
        bbox_reg_weights=None,
        score_thresh=LEAST_SCORE,
        nms_thresh=0.5,
        detections_per_img=config.detections,
        mask_roi_pool=MultiScaleRoIAlign(list(outlined), config.region_size, sampling_ratio=1),
        mask_head=MaskHead(config, channels, sum(trunk.finer.values())),
        mask_predictor=nn.Identity(),
        keypoint_head=KeypointHead(config, channels),
        margin=config.region_margin,
        fine_pools=[MultiScaleRoIAlign([name], cells, sampling_ratio=1) for name in trunk.finer],
        attribute_head=AttributeHead(config),
    )


def count_parameters(network: nn.Module) -> int:
    """How many numbers a network learns."""
    return sum(p.numel() for p in network.parameters() if p.requires_grad)
