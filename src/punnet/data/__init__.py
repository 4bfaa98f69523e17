"""Labelled images: one data model, readers and writers one file a format."""

from punnet.data.coco import read_coco, write_coco
from punnet.data.cvat import read_cvat
from punnet.data.dataset import STAGES, AnnotatedImage, Annotation, Dataset, LabelPixels, Segmentation
from punnet.data.formats import read_dataset
from punnet.data.from_berries import annotate_image, to_annotations
from punnet.data.labelme import read_labelme
from punnet.data.overlap import merge_by_overlap
from punnet.data.picking_points import read_picking_points
from punnet.data.psd import read_psd
from punnet.data.strawdi import read_strawdi
from punnet.data.supervision_bridge import from_supervision, to_supervision
from punnet.data.via import read_via
from punnet.data.yolo import read_yolo
from punnet.data.yolo_writer import write_yolo

__all__ = [
    "STAGES",
    "AnnotatedImage",
    "Annotation",
    "Dataset",
    "LabelPixels",
    "Segmentation",
    "annotate_image",
    "from_supervision",
    "merge_by_overlap",
    "read_coco",
    "read_cvat",
    "read_dataset",
    "read_labelme",
    "read_picking_points",
    "read_psd",
    "read_strawdi",
    "read_via",
    "read_yolo",
    "to_annotations",
    "to_supervision",
    "write_coco",
    "write_yolo",
]
