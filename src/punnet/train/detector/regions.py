"""torchvision's proposal network and region heads, taught to ignore, to see with a margin, and to read attributes."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torchvision.models.detection.roi_heads import (
    RoIHeads,
    fastrcnn_loss,
    keypointrcnn_loss,
    maskrcnn_loss,
)
from torchvision.models.detection.rpn import RegionProposalNetwork
from torchvision.ops import MultiScaleRoIAlign, box_area

from punnet.train.detector.heads import AttributeHead, ripeness_loss, visibility_loss

__all__ = ["BerryProposals", "BerryRegionHeads", "enlarged"]

Target = dict[str, Tensor]
IGNORED_SHARE = 0.5  # of an anchor's or a proposal's area, inside a berry that is not counted
_IGNORED = -1


def enlarged(boxes: Tensor, margin: float) -> Tensor:
    """Boxes (N, 4) xyxy scaled about their centres by 1 + ``margin``."""
    sizes = (boxes[:, 2:] - boxes[:, :2]) * (margin / 2)
    return torch.cat((boxes[:, :2] - sizes, boxes[:, 2:] + sizes), dim=1)


def _inside_ignored(boxes: Tensor, ignored: Tensor) -> Tensor:
    """(N,) whether more than half of each box lies in one of the areas (K, 4) that are to be ignored."""
    if not len(ignored):
        return torch.zeros(len(boxes), dtype=torch.bool, device=boxes.device)
    low = torch.maximum(boxes[:, None, :2], ignored[None, :, :2])
    high = torch.minimum(boxes[:, None, 2:], ignored[None, :, 2:])
    shared = (high - low).clamp(min=0).prod(dim=2).max(dim=1).values
    inside: Tensor = shared > IGNORED_SHARE * box_area(boxes)
    return inside


class BerryProposals(RegionProposalNetwork):  # type: ignore[misc]
    """Proposes from the coarser maps only, and learns nothing from berries that are not counted."""

    def __init__(self, levels: tuple[str, ...], *arguments: Any, **settings: Any) -> None:
        super().__init__(*arguments, **settings)
        self.levels = levels

    def forward(
        self, images: Any, features: dict[str, Tensor], targets: list[Target] | None = None
    ) -> tuple[list[Tensor], dict[str, Tensor]]:
        """As torchvision's, on the maps in ``levels``."""
        found: tuple[list[Tensor], dict[str, Tensor]] = super().forward(
            images, {name: features[name] for name in self.levels}, targets
        )
        return found

    def assign_targets_to_anchors(
        self, anchors: list[Tensor], targets: list[Target]
    ) -> tuple[list[Tensor], list[Tensor]]:
        """As torchvision's; background anchors inside ignored areas are left out."""
        labels, boxes = super().assign_targets_to_anchors(anchors, targets)
        for label, anchor, target in zip(labels, anchors, targets, strict=True):
            label[(label == 0) & _inside_ignored(anchor, target["ignored"])] = _IGNORED
        return labels, boxes


class BerryRegionHeads(RoIHeads):  # type: ignore[misc]
    """Class and box; then, on the enlarged box, mask, heat-maps, visibility and ripeness from the same cells.

    Differs from torchvision's in that masks and key-points are read off one enlarged region, that labels may be
    partial (an annotation without mask, or without key-points), and in the attributes.
    """

    def __init__(
        self,
        *arguments: Any,
        margin: float,
        fine_pools: list[MultiScaleRoIAlign],
        attribute_head: AttributeHead,
        **settings: Any,
    ) -> None:
        super().__init__(*arguments, **settings)
        self.margin = margin
        self.fine_pools = nn.ModuleList(fine_pools)
        self.attribute_head = attribute_head

    def select_training_samples(self, proposals: list[Tensor], targets: list[Target] | None) -> Any:
        """As torchvision's; background regions inside ignored areas are left out."""
        assert targets is not None
        kept = []
        for proposal, target in zip(proposals, targets, strict=True):
            kept.append(proposal[~_inside_ignored(proposal, target["ignored"])])
        return super().select_training_samples(kept, targets)

    def forward(
        self,
        features: dict[str, Tensor],
        proposals: list[Tensor],
        image_shapes: list[tuple[int, int]],
        targets: list[Target] | None = None,
    ) -> tuple[list[dict[str, Tensor]], dict[str, Tensor]]:
        """Detections in use; losses by term in training."""
        if self.training:
            assert targets is not None
            return [], self._losses(features, proposals, image_shapes, targets)
        logits, deltas = self.box_predictor(
            self.box_head(self.box_roi_pool(features, proposals, image_shapes))
        )
        boxes, scores, labels = self.postprocess_detections(logits, deltas, proposals, image_shapes)
        regions = [enlarged(b, self.margin) for b in boxes]
        read = self._read(features, regions, image_shapes)
        counts = [len(b) for b in boxes]
        # Of one image nothing is to be split, so that an exported graph does not hold the split.
        columns = {k: torch.split(v, counts) if len(counts) > 1 else (v,) for k, v in read.items()}
        return [
            {"boxes": boxes[i], "scores": scores[i], "labels": labels[i], "regions": regions[i]}
            | {name: column[i] for name, column in columns.items()}
            for i in range(len(boxes))
        ], {}

    def _read(
        self, features: dict[str, Tensor], regions: list[Tensor], image_shapes: list[tuple[int, int]]
    ) -> dict[str, Tensor]:
        cells = self.mask_roi_pool(features, regions, image_shapes)
        finer = self._finer(features, regions, image_shapes)
        heatmaps, deeper = self.keypoint_head(cells)
        visibility, ripeness = self.attribute_head(deeper)
        return {
            "masks": torch.sigmoid(self.mask_head(cells, finer))[:, 0],
            "heatmaps": heatmaps,
            "visibility": torch.softmax(visibility, dim=-1),
            "ripeness": torch.sigmoid(ripeness),
        }

    def _finer(
        self, features: dict[str, Tensor], regions: list[Tensor], image_shapes: list[tuple[int, int]]
    ) -> list[Tensor]:
        """The finer maps over the regions, with as many cells as the mask has."""
        return [pool(features, regions, image_shapes) for pool in self.fine_pools]

    def _losses(
        self,
        features: dict[str, Tensor],
        proposals: list[Tensor],
        image_shapes: list[tuple[int, int]],
        targets: list[Target],
    ) -> dict[str, Tensor]:
        proposals, matched, labels, regression = self.select_training_samples(proposals, targets)
        logits, deltas = self.box_predictor(
            self.box_head(self.box_roi_pool(features, proposals, image_shapes))
        )
        if sum(map(len, labels)):
            classes, box = fastrcnn_loss(logits, deltas, labels, regression)
        else:  # nothing but ignored areas: a mean over no region would not be a number
            classes, box = logits.sum() * 0, deltas.sum() * 0
        positive = [label > 0 for label in labels]
        regions = [enlarged(p[chosen], self.margin) for p, chosen in zip(proposals, positive, strict=True)]
        berries = [m[chosen] for m, chosen in zip(matched, positive, strict=True)]
        cells = self.mask_roi_pool(features, regions, image_shapes)
        heatmaps, deeper = self.keypoint_head(cells)
        visibility, ripeness = self.attribute_head(deeper)
        allowed = torch.cat([t["visibility"][b] for t, b in zip(targets, berries, strict=True)])
        shares = torch.cat([t["ripeness"][b] for t, b in zip(targets, berries, strict=True)])
        return {
            "classes": classes,
            "box": box,
            "mask": self._mask_loss(
                cells, self._finer(features, regions, image_shapes), regions, berries, targets
            ),
            "keypoint": keypointrcnn_loss(
                heatmaps.float().contiguous(), regions, [t["keypoints"] for t in targets], berries
            ),
            "visibility": visibility_loss(visibility, allowed),
            "ripeness": ripeness_loss(ripeness, shares),
        }

    def _mask_loss(
        self,
        cells: Tensor,
        finer: list[Tensor],
        regions: list[Tensor],
        berries: list[Tensor],
        targets: list[Target],
    ) -> Tensor:
        """Eq. 3.5 over the berries that have a mask; one mask for all classes."""
        outlined = [t["has_mask"][b] for t, b in zip(targets, berries, strict=True)]
        chosen = torch.cat(outlined)
        logits = self.mask_head(cells[chosen], [one[chosen] for one in finer])
        loss: Tensor = maskrcnn_loss(
            logits.float(),
            [r[o] for r, o in zip(regions, outlined, strict=True)],
            [t["masks"] for t in targets],
            [torch.zeros_like(t["labels"]) for t in targets],
            [b[o] for b, o in zip(berries, outlined, strict=True)],
        )
        return loss
