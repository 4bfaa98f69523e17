"""Reading and writing labelled images, one file a format."""

from punnet.data.coco import CocoDataset, CocoItem, detections_to_coco, read_psd, read_strawdi

__all__ = ["CocoDataset", "CocoItem", "detections_to_coco", "read_psd", "read_strawdi"]
