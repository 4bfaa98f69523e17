"""CVAT: masks exported as COCO and skeletons as COCO Keypoints, each for itself, merged by overlap."""

from __future__ import annotations

import warnings
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

    The class of a berry is that of its mask; what the skeletons are called does not matter. Attributes of both are kept;
    where both have one, the mask's counts.

    Crowd is what ``iscrowd`` says, or the attribute ``is_crowd`` where the file has it. Of a label without that attribute
    CVAT writes ``iscrowd`` for everything drawn with the brush: where all berries are marked so, none is crowd, with a
    warning.

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
    return merge_by_overlap(_with_crowds(berries), read_coco(found, image_folder, class_map=names))


def _with_crowds(berries: Dataset) -> Dataset:
    """Which berries are crowd, as their annotator meant it."""
    told = [_told_crowd(annotation) for image in berries for annotation in image.annotations]
    flags = [annotation.crowd for image in berries for annotation in image.annotations]
    drawn = bool(flags) and all(flags) and all(one is None for one in told)
    if drawn:
        warnings.warn(
            f"{berries.name}: all {len(flags)} berries are marked iscrowd, as CVAT does with what is drawn by brush; "
            "they are taken as berries. To mark crowd, give the label an attribute is_crowd",
            stacklevel=3,
        )

    def marked(annotation: Annotation) -> Annotation:
        one = _told_crowd(annotation)
        return replace(annotation, crowd=not drawn and (annotation.crowd if one is None else one))

    return replace(
        berries,
        images=tuple(replace(image, annotations=tuple(map(marked, image.annotations))) for image in berries),
    )


def _told_crowd(annotation: Annotation) -> bool | None:
    """What the attribute says; None if there is none."""
    attributes = annotation.extra.get("attributes")
    given = attributes.get("is_crowd") if isinstance(attributes, dict) else None
    return None if given is None else str(given).lower() not in ("false", "0", "")


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
