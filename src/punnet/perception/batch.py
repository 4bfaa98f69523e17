"""Detection over many photographs: one picture and one JSON a photograph, one COCO file of all."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2

from punnet.data import AnnotatedImage, Dataset, annotate_image, write_coco
from punnet.errors import FileFormatError, OutputError, PunnetError
from punnet.outputs import OutputFolder
from punnet.perception.detector import Detector
from punnet.scene import Frame, Strawberries, read_image
from punnet.scene.overlay import draw_overlay

__all__ = ["PHOTO_SUFFIXES", "PhotoResult", "detect_photos", "list_photos"]

PHOTO_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
JPEG_QUALITY = 92


@dataclass(frozen=True)
class PhotoResult:
    """What came of one photograph: how many berries, or the ``error`` that says why there is nothing."""

    photo: Path
    name: str
    berries: int = 0
    pluckable: int = 0
    seconds: float = 0.0
    error: str | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values; paths of the results are relative to the output folder."""
        found = self.error is None
        return {
            "photo": str(self.photo),
            "berries": self.berries,
            "pluckable": self.pluckable,
            "seconds": round(self.seconds, 4),
            "overlay": f"overlays/{self.name}.jpg" if found else None,
            "strawberries": f"berries/{self.name}.json" if found else None,
            "error": self.error,
        }


def list_photos(source: str | Path) -> list[Path]:
    """Return the photograph itself, or those directly in a folder, by name.

    Raises
    ------
    FileFormatError
        If nothing is there, or a folder holds no file with one of :data:`PHOTO_SUFFIXES`.
    """
    source = Path(source)
    if source.is_dir():
        photos = sorted(
            path
            for path in source.iterdir()
            if path.suffix.lower() in PHOTO_SUFFIXES and path.is_file() and not path.name.startswith(".")
        )
        if not photos:
            raise FileFormatError(
                f"{source}: no photographs in this folder; looked for {' '.join(PHOTO_SUFFIXES)}"
            )
        return photos
    if not source.exists():
        raise FileFormatError(f"{source}: no such file or folder")
    return [source]


def detect_photos(photos: Iterable[Path], detector: Detector, output: OutputFolder) -> Iterator[PhotoResult]:
    """Detect photograph by photograph; a bad one is reported and left out.

    Writes ``overlays/<name>.jpg`` and ``berries/<name>.json`` (:meth:`Strawberries.to_json`) as it goes and,
    when all are done or the work is stopped, ``detections.json`` (COCO, :func:`~punnet.data.write_coco`) of what there
    is.

    Yields
    ------
    PhotoResult
        One a photograph, in order.
    """
    for folder in ("overlays", "berries"):
        (output.path / folder).mkdir()
    done: list[PhotoResult] = []
    try:
        for photo in photos:
            result = _detect_photo(photo, _free_name(photo, done), detector, output)
            done.append(result)
            yield result
    finally:
        _write_coco(output.path, [result for result in done if result.error is None])


def _detect_photo(photo: Path, name: str, detector: Detector, output: OutputFolder) -> PhotoResult:
    begin = perf_counter()
    try:
        frame = Frame(rgb=read_image(photo), name=photo.name)
        berries = detector.detect(frame)
    except PunnetError as error:
        return PhotoResult(photo, name, error=str(error))
    seconds = perf_counter() - begin
    picture = draw_overlay(frame.rgb, berries)
    _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    try:
        (output.path / "overlays" / f"{name}.jpg").write_bytes(encoded.tobytes())
        (output.path / "berries" / f"{name}.json").write_text(json.dumps(berries.to_json()) + "\n")
    except OSError as error:
        raise OutputError(f"{output.folder}: can't be written ({error.strerror})") from error
    output.finished()
    return PhotoResult(photo, name, len(berries), int(berries.pluckable.sum()), seconds)


def _free_name(photo: Path, done: list[PhotoResult]) -> str:
    """Return the stem, or the whole name where ``a.png`` stands beside ``a.jpg``."""
    return photo.name if any(result.name == photo.stem for result in done) else photo.stem


def _write_coco(folder: Path, results: list[PhotoResult]) -> None:
    images: list[AnnotatedImage] = []
    written = 0
    for number, result in enumerate(results, start=1):
        # Read back one by one: as run lengths the masks of a season's photographs fit in memory together.
        berries = _read_berries(folder / "berries" / f"{result.name}.json")
        images.append(annotate_image(berries, result.photo, identity=number, first_annotation=written + 1))
        written += len(berries)
    write_coco(Dataset(tuple(images), name="detections"), folder / "detections.json")


def _read_berries(path: Path) -> Strawberries:
    return Strawberries.from_json(json.loads(path.read_text()))
