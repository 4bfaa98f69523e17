"""The folder of a simulated data set: how it is begun, gone on with, filled plant by plant, and completed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import punnet
from punnet.outputs import write_bytes
from punnet.scene import CLASSES, KEYPOINTS
from punnet.sim.growing_folder import (
    DEPTH_UNIT,
    PICTURES_AND_SHARDS,
    finish_folder,
    json_bytes,
    open_folder,
    shard_path,
    write_pictures,
)
from punnet.sim.labelled_views import LabelledView
from punnet.sim.protocols import VARIED, Protocol
from punnet.sim.still_scene import PHOTO_INTRINSICS

__all__ = ["FactoryReport", "complete", "describe", "is_finished", "open_set", "write_shard", "write_view"]

SCHEMA = "punnet-simulated-data/1"
GENERATOR = 1
"""Raised whenever the same seed gives other bytes."""

_DESCRIPTION, _ANNOTATIONS = "data.json", "annotations.json"
_LICENCES = [
    {"id": 1, "name": "CC0 1.0", "url": "https://creativecommons.org/publicdomain/zero/1.0/"},
    {
        "id": 2,
        "name": "CC BY 4.0 (leaf textures, see punnet/sim/assets/leaves/ATTRIBUTION.txt)",
        "url": "https://creativecommons.org/licenses/by/4.0/",
    },
]


@dataclass(frozen=True)
class FactoryReport:
    """What a run has made.

    Parameters
    ----------
    folder
        Where the data set is.
    images, plants, annotations, crowd
        How many there are in it; ``annotations`` includes ``crowd``.
    made, kept
        Images made by this run, and by earlier ones.
    megabytes
        On disk.
    """

    folder: Path
    images: int
    plants: int
    annotations: int
    crowd: int
    made: int
    kept: int
    megabytes: float


def describe(images: int, seed: int, protocol: Protocol = VARIED) -> dict[str, Any]:
    """Write down what decides the bytes of the data set."""
    kind = {} if protocol is VARIED else {"protocol": protocol.name}
    options = "".join(f"--{name} {value} " for name, value in kind.items())
    return {
        "schema": SCHEMA,
        "command": f"punnet data simulate {options}--images {images} --seed {seed}",
        "punnet": punnet.__version__,
        "generator": GENERATOR,
        **kind,
        "images": images,
        "seed": seed,
        "complete": False,
    }


def open_set(place: Path, description: dict[str, Any], *, force: bool) -> None:
    """Make the folder, or find that it holds the beginning of the same data set; see :func:`open_folder`."""
    open_folder(
        place,
        _DESCRIPTION,
        description,
        what="simulated data set",
        parts=PICTURES_AND_SHARDS,
        force=force,
    )
    camera = {"depth_scale": DEPTH_UNIT, "camera": PHOTO_INTRINSICS.to_json()}
    write_bytes(place / "camera.json", json_bytes(camera), force=True)


def write_view(folder: Path, name: str, group: str, setting: str, labelled: LabelledView) -> dict[str, Any]:
    """Write colour and depth; the image's entry of the shard."""
    rgb, depth = write_pictures(folder, name, labelled.rgb, labelled.depth)
    image = {
        "file_name": rgb,
        "width": PHOTO_INTRINSICS.width,
        "height": PHOTO_INTRINSICS.height,
        "depth_path": depth,
        "camera": PHOTO_INTRINSICS.to_json(),
        "T_base_camera": [[round(float(v), 7) for v in row] for row in labelled.T_base_camera],
        "group": group,
        "view": labelled.view,
        "setting": setting,
    }
    return {"image": image, "annotations": labelled.annotations}


def complete(place: Path, description: dict[str, Any], plants: int, *, made: int) -> FactoryReport:
    """Join the shards into ``annotations.json``, in the order of the plants."""
    images: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for plant in range(plants):
        for entry in json.loads(shard_path(place, plant).read_text()):
            images.append({"id": len(images) + 1, **entry["image"]})
            for annotation in entry["annotations"]:
                ids = {"id": len(annotations) + 1, "image_id": len(images)}
                annotations.append(ids | annotation)
    skeleton = [[1, 2], [2, 3], [4, 5]]
    categories = [
        {"id": number, "name": name, "keypoints": list(KEYPOINTS), "skeleton": skeleton}
        for number, name in enumerate(CLASSES, start=1)
    ]
    description = description | {"complete": True}
    document = {
        "info": {"description": "Simulated strawberries, labelled exactly", **description},
        "licenses": _LICENCES,
        "images": images,
        "annotations": annotations,
        "categories": categories,
    }
    text = json.dumps(document, allow_nan=False, separators=(",", ":"))
    write_bytes(place / _ANNOTATIONS, text.encode(), force=True)
    write_bytes(place / _DESCRIPTION, json_bytes(description), force=True)
    finish_folder(place)
    size = sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
    return FactoryReport(
        folder=place,
        images=len(images),
        plants=plants,
        annotations=len(annotations),
        crowd=sum(annotation["iscrowd"] for annotation in annotations),
        made=made,
        kept=len(images) - made,
        megabytes=size / 1e6,
    )


def is_finished(place: Path, plant: int) -> bool:
    """Whether a plant's images and labels are all there."""
    return shard_path(place, plant).is_file()


def write_shard(place: Path, plant: int, entries: list[dict[str, Any]]) -> None:
    """Write a plant's labels, the entries of :func:`write_view`: from then on it counts as finished."""
    write_bytes(shard_path(place, plant), json_bytes(entries), force=True)
