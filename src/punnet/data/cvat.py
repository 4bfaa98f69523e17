"""CVAT: masks exported as COCO and skeletons as COCO Keypoints, each for itself, merged by overlap."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from punnet.data.class_names import ClassMap
from punnet.data.coco import open_coco, read_coco
from punnet.data.dataset import Annotation, Dataset
from punnet.data.overlap import merge_by_overlap
from punnet.errors import FileFormatError

__all__ = ["find_exports", "read_cvat"]

INSTANCES, KEYPOINTS = "instances_*.json", "person_keypoints_*.json"


def read_cvat(
    instances: str | Path,
    keypoints: str | Path | None = None,
    image_folder: str | Path | None = None,
    *,
    class_map: ClassMap | None = None,
) -> Dataset:
    """Read both exports of a task as one data set (:func:`~punnet.data.overlap.merge_by_overlap`).

    The class of a berry is that of its mask; what the skeletons are called does not matter. CVAT writes ``iscrowd`` for
    everything drawn with the brush, so a berry is crowd here only if its attribute ``is_crowd`` says so.

    Parameters
    ----------
    instances
        File of the masks, or the folder into which both archives were unpacked.
    keypoints
        File of the skeletons; None if ``instances`` is a folder.
    image_folder
        Folder of the photographs; looked for beside the file if None.
    class_map
        What labels of masks mean that are not known here.

    Raises
    ------
    FileFormatError
        If a file is missing or damaged, a class not known, or the two are not of the same photographs.
    """
    masks = Path(instances)
    if masks.is_dir():
        masks, found = find_exports(masks)
    elif keypoints is None:
        raise FileFormatError(f"{masks}: the file of the key-points is needed too, or the folder of both")
    else:
        found = Path(keypoints)
    skeletons = open_coco(found)
    names = {str(category.get("name")): "pluckable" for category in skeletons.categories().values()}
    berries = read_coco(masks, image_folder, class_map=class_map)
    berries = replace(
        berries,
        images=tuple(
            replace(image, annotations=tuple(_marked_crowd(annotation) for annotation in image.annotations))
            for image in berries
        ),
    )
    return merge_by_overlap(berries, read_coco(found, image_folder, class_map=names))


def _marked_crowd(annotation: Annotation) -> Annotation:
    attributes = annotation.extra.get("attributes")
    marked = attributes.get("is_crowd") if isinstance(attributes, dict) else None
    return replace(annotation, crowd=bool(marked) and str(marked).lower() not in ("false", "0"))


def find_exports(folder: Path) -> tuple[Path, Path]:
    """The files of masks and of skeletons in ``folder`` or its ``annotations``.

    Raises
    ------
    FileFormatError
        If there is not exactly one of each.
    """
    found = []
    for pattern in (INSTANCES, KEYPOINTS):
        files = [file for place in (folder, folder / "annotations") for file in sorted(place.glob(pattern))]
        if len(files) != 1:
            raise FileFormatError(
                f"{folder}: one file {pattern} is needed here or in annotations/, found {len(files)}"
            )
        found.append(files[0])
    return found[0], found[1]
