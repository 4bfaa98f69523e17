"""Contact sheets: pages of annotated photographs side by side, with a legend; in a folder, or one as a picture."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage, Dataset
from punnet.data.drawing import draw_annotated, write_line
from punnet.errors import ConfigurationError
from punnet.outputs import OutputFolder, write_bytes
from punnet.scene import CLASSES, KEYPOINTS, Strawberries, Visibility
from punnet.scene.overlay import CLASS_COLOURS, draw_overlay

__all__ = ["PICTURE_SUFFIXES", "SheetLayout", "contact_sheet", "write_contact_sheets", "write_one_sheet"]

PICTURE_SUFFIXES = (".jpeg", ".jpg", ".png")
"""What a sheet can be written as."""

BACKGROUND = (24, 24, 26)
HEADER, CAPTION, GAP = 44, 22, 6
LARGEST_PAGE = 60_000_000
MARKS = (
    (Visibility.VISIBLE, "visible"),
    (Visibility.HIDDEN_BY_ITSELF, "hidden by itself"),
    (Visibility.HIDDEN_BY_OTHER, "hidden by other"),
)


@dataclass(frozen=True)
class SheetLayout:
    """How photographs stand on a page.

    Parameters
    ----------
    columns, rows
        Photographs across and down.
    cell
        Longest side of each in pixels.

    Raises
    ------
    ConfigurationError
        If one is below 1, cells are below 64 pixels, or a page would be too large.
    """

    columns: int = 4
    rows: int = 4
    cell: int = 480

    def __post_init__(self) -> None:
        if self.columns < 1 or self.rows < 1 or self.cell < 64:
            raise ConfigurationError(
                f"contact sheet: {self.columns} columns, {self.rows} rows of {self.cell} px; "
                "at least one of each and 64 px are needed"
            )
        if self.columns * self.rows * self.cell**2 > LARGEST_PAGE:
            raise ConfigurationError(
                f"contact sheet: {self.columns}×{self.rows} photographs of {self.cell} px make too large a page; "
                "take fewer or smaller ones"
            )

    @property
    def on_a_page(self) -> int:
        """Photographs on a page."""
        return self.columns * self.rows

    def pages(self, images: int) -> int:
        """Pages that so many photographs take."""
        return -(-images // self.on_a_page)


def contact_sheet(images: list[AnnotatedImage], layout: SheetLayout, title: str) -> NDArray[np.uint8]:
    """Draw one page, (H, W, 3) uint8 RGB: each photograph with name and counts below, classes and marks above."""
    cells = [_cell(image, layout.cell) for image in images]
    rows = [cells[i : i + layout.columns] for i in range(0, len(cells), layout.columns)]
    width = layout.columns * (layout.cell + GAP) + GAP
    heights = [max(cell.shape[0] for cell in row) for row in rows]
    page = np.full((HEADER + sum(heights) + GAP * len(rows), width, 3), BACKGROUND, dtype=np.uint8)
    _legend(page, title)
    top = HEADER
    for row, height in zip(rows, heights, strict=True):
        for column, cell in enumerate(row):
            left = GAP + column * (layout.cell + GAP)
            page[top : top + cell.shape[0], left : left + cell.shape[1]] = cell
        top += height + GAP
    return page


def write_contact_sheets(
    dataset: Dataset, output: OutputFolder, layout: SheetLayout | None = None
) -> Iterator[Path]:
    """Write ``sheet-001.png`` … of all images, in order.

    Parameters
    ----------
    dataset
        What to show.
    output
        An open folder.
    layout
        The usual one if None.

    Yields
    ------
    Path
        Each page when it is written; in the folder's staging place.
    """
    layout = layout or SheetLayout()
    pages = layout.pages(len(dataset))
    for number in range(pages):
        path = output.path / f"sheet-{number + 1:0{max(3, len(str(pages)))}d}.png"
        path.write_bytes(_encoded(_page(dataset, number, layout), path.suffix))
        output.finished()
        yield path


def write_one_sheet(
    dataset: Dataset, path: str | Path, layout: SheetLayout | None = None, *, force: bool = False
) -> Path:
    """Write all images on one page, as the picture that the name ends in.

    Parameters
    ----------
    dataset
        What to show.
    path
        With one of :data:`PICTURE_SUFFIXES`.
    layout
        The usual one if None.
    force
        Replace the picture if it exists.

    Raises
    ------
    ConfigurationError
        If there are more images than the page holds.
    OutputExistsError, OutputError
        As :func:`~punnet.outputs.write_bytes`.
    """
    layout, path = layout or SheetLayout(), Path(path)
    if (pages := layout.pages(len(dataset))) > 1:
        raise ConfigurationError(
            f"{path}: is one picture, but {len(dataset)} images take {pages} sheets of {layout.on_a_page}; give a folder, "
            "or more columns and rows"
        )
    return write_bytes(path, _encoded(_page(dataset, 0, layout), path.suffix.lower()), force=force)


def _page(dataset: Dataset, number: int, layout: SheetLayout) -> NDArray[np.uint8]:
    first = number * layout.on_a_page
    images = list(dataset.images[first : first + layout.on_a_page])
    title = f"{dataset.name}: {first + 1} to {first + len(images)} of {len(dataset)} images"
    return contact_sheet(images, layout, title)


def _encoded(page: NDArray[np.uint8], suffix: str) -> bytes:
    _, encoded = cv2.imencode(suffix, page[:, :, ::-1])
    return bytes(encoded.tobytes())


def _cell(image: AnnotatedImage, longest_side: int) -> NDArray[np.uint8]:
    picture = draw_annotated(image, longest_side)
    caption = np.full((CAPTION, longest_side, 3), BACKGROUND, dtype=np.uint8)
    counts = [sum(a.class_index == k and not a.crowd for a in image.annotations) for k in range(len(CLASSES))]
    crowd = sum(annotation.crowd for annotation in image.annotations)
    parts = [f"{count} {name}" for count, name in zip(counts, CLASSES, strict=True) if count]
    parts += [f"{crowd} crowd"] if crowd else []
    write_line(caption, f"{image.path.name}: {', '.join(parts) or 'no annotation'}", CAPTION - 7)
    cell = np.full((picture.shape[0] + CAPTION, longest_side, 3), BACKGROUND, dtype=np.uint8)
    cell[: picture.shape[0], : picture.shape[1]] = picture
    cell[picture.shape[0] :] = caption
    return cell


def _legend(page: NDArray[np.uint8], title: str) -> None:
    """Title, colours of the classes, and the three marks of a key-point as the overlay draws them."""
    write_line(page, title, 17, 0.5)
    u = 6
    for name, colour in zip(CLASSES, CLASS_COLOURS, strict=True):
        u = _entry(page, u, name, colour)
    u = _entry(page, u, "crowd", (170, 170, 170))
    for code, words in MARKS:
        if u + 40 < page.shape[1]:
            page[24:42, u : u + 16] = _mark(code)
        u = _entry(page, u, f"key-point {words}", None)


def _entry(page: NDArray[np.uint8], u: int, words: str, colour: tuple[int, int, int] | None) -> int:
    """One swatch, if any, and its words; returns where the next begins."""
    if colour is not None:
        cv2.rectangle(page, (u, 27), (u + 12, 38), colour, cv2.FILLED)
    extent, _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 0.42, 1)
    cv2.putText(page, words, (u + 18, 37), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (235, 235, 235), 1, cv2.LINE_AA)
    return u + 18 + extent[0] + 16


def _mark(code: Visibility) -> NDArray[np.uint8]:
    """(18, 16, 3) picture of a key-point, drawn by the overlay itself."""
    tile = np.full((90, 90, 3), BACKGROUND, dtype=np.uint8)
    points = np.full((1, len(KEYPOINTS), 2), np.nan)
    points[0, 0], points[0, 3] = (45, 45), (45, 900)  # the second, far outside, makes the berry a large one
    berry = Strawberries(
        image_size=(90, 90),
        boxes=np.array([[300.0, 300.0, 400.0, 400.0]]),
        keypoints=points,
        visibility=np.array([[code, 0, 0, Visibility.VISIBLE, 0]]),
    )
    return draw_overlay(tile, berry, labels=[" "])[36:54, 37:53]
