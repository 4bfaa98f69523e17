"""Labelled images: one data model, readers and writers one file a format."""

from punnet.data.coco import read_coco, write_coco
from punnet.data.dataset import STAGES, AnnotatedImage, Annotation, Dataset, LabelPixels, Segmentation
from punnet.data.formats import read_dataset
from punnet.data.from_berries import annotate_image, to_annotations
from punnet.data.psd import read_psd
from punnet.data.strawdi import read_strawdi

__all__ = [
    "STAGES",
    "AnnotatedImage",
    "Annotation",
    "Dataset",
    "LabelPixels",
    "Segmentation",
    "annotate_image",
    "read_coco",
    "read_dataset",
    "read_psd",
    "read_strawdi",
    "to_annotations",
    "write_coco",
]
