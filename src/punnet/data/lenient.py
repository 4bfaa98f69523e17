"""Read what can be read of a damaged data set, and say what was left out and why."""

from __future__ import annotations

import json
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from punnet.data.class_names import ClassMap
from punnet.data.coco import read_coco
from punnet.data.dataset import AnnotatedImage, Dataset
from punnet.data.faults import Fault
from punnet.data.fixing import rebase
from punnet.data.formats import guess_format, read_dataset
from punnet.data.image_checks import Progress
from punnet.data.raw_coco import RawCoco, find_coco_file, open_raw_coco
from punnet.data.reading import image_size
from punnet.data.validation import validate_entries
from punnet.errors import FileFormatError
from punnet.outputs import write_text

__all__ = ["read_readable", "with_photographs"]

DECODERS = 2

# What a reader can do without: the label is there, if not as it should be.
HARMLESS = frozenset(
    {"foreign-class", "duplicate-file-name", "missing-image", "unreadable-image", "size-mismatch"}
    | {"missing-depth", "box-outside-image", "polygon-outside-image", "empty-mask", "area-mismatch"}
    | {"keypoint-outside-box", "keypoint-outside-image", "keypoint-total"}
)


def read_readable(
    path: str | Path,
    format: str | None = None,  # noqa: A002
    *,
    class_map: ClassMap | None = None,
) -> tuple[Dataset, list[Fault]]:
    """Read a data set as :func:`~punnet.data.read_dataset` does; of a damaged COCO file, all but the damaged entries.

    Returns
    -------
    dataset
        What could be read.
    left_out
        Why the rest could not.

    Raises
    ------
    FileFormatError
        If nothing is at the path, its format can't be guessed, or it is damaged beyond that.
    ConfigurationError
        If there is no such format, or the class map leads to no class.
    """
    try:
        return read_dataset(path, format, class_map=class_map), []
    except FileFormatError:
        if not Path(path).exists() or (format or _guess(Path(path))) != "coco":
            raise
        raw = open_raw_coco(find_coco_file(path))
        report = validate_entries(raw, class_map)
        left_out = [fault for fault in report.faults if fault.code not in HARMLESS]
        if not left_out:
            raise
    return _read_rest(raw, left_out, class_map), left_out


def _guess(path: Path) -> str:
    """The format; also of a COCO file whose JSON is not strict."""
    try:
        return guess_format(path)
    except FileFormatError as error:
        try:
            open_raw_coco(path)
        except FileFormatError:
            raise error from None
        return "coco"


def with_photographs(dataset: Dataset, progress: Progress | None = None) -> tuple[Dataset, list[str]]:
    """The images whose photograph is there, readable and of the size that is annotated; each is decoded once.

    Returns
    -------
    dataset
        Those images.
    left_out
        What is wrong with the others.
    """
    kept: list[int] = []
    left_out: list[str] = []
    with ThreadPoolExecutor(DECODERS) as pool:
        for index, problem in enumerate(pool.map(_problem, dataset)):
            if problem is None:
                kept.append(index)
            else:
                left_out.append(problem)
            if progress is not None:
                progress(index + 1, len(dataset))
    return dataset.subset(kept), left_out


def _problem(image: AnnotatedImage) -> str | None:
    try:
        size = image_size(image.path)
    except FileFormatError as error:
        return str(error)
    if size == image.size:
        return None
    return (
        f"{image.path}: is {size[1]}×{size[0]}, its annotations are for {image.width}×{image.height}; "
        "annotate it again, or give the photograph that was annotated"
    )


def _read_rest(raw: RawCoco, left_out: list[Fault], class_map: ClassMap | None) -> Dataset:
    faulty = {(fault.annotation_id is not None, fault.position) for fault in left_out}
    images = [image for position, image in enumerate(raw.images) if (False, position) not in faulty]
    listed = {image["id"] for image in images}
    # Annotations of an image that was left out go with it.
    annotations = [
        annotation
        for position, annotation in enumerate(raw.annotations)
        if (True, position) not in faulty and annotation["image_id"] in listed
    ]
    data = {**raw.data, "images": images, "annotations": annotations}
    with tempfile.TemporaryDirectory(prefix="punnet-") as folder:
        place = Path(folder).resolve()
        rebase(data, raw.path.parent.resolve(), raw.image_folder.resolve(), place)
        dataset = read_coco(write_text(place / raw.path.name, json.dumps(data)), class_map=class_map)
    return replace(dataset, name=raw.path.parent.resolve().name or raw.path.stem)
