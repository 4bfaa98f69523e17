r"""Shape, size, occlusion, ripeness and weight of simulated berries beside those of real ones.

    punnet data simulate --images 3000 --seed 1 --workers 2 --out train
    python benchmarks/simulated_statistics.py --simulated train --real ../shared/data \
        --figure docs/figures/simulated-data.png --sheet docs/figures/simulated-images.jpg

Real outlines: StrawDI_Db1, 16,234 polygons in 2,800 photographs (``strawdi_masks``); real weights: the berries weighed
for Tafuro et al., ICRA 2022 (``dyson``). Only histograms of them leave this script. Outlines are compared at the same
image width and from the same least area on; what the image's edge cuts is left out of shape and size.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH, LEAST_AREA, UNBROKEN = 640, 150, 0.95
RED_STAGES = ("turning", "ripe", "overripe", "rotten")


@dataclass(frozen=True)
class Outlines:
    """One row an outline: image, whether it has reddened, √area over the image width, solidity, and so on."""

    image: NDArray[np.int64]
    red: NDArray[np.bool_]
    size: NDArray[np.float64]
    solidity: NDArray[np.float64]
    elongation: NDArray[np.float64]
    cut: NDArray[np.bool_]
    classes: dict[str, float]


def measure(polygon: NDArray[np.float64], height: float) -> tuple[float, float, float, bool] | None:
    """√area over width, solidity, long over short side, and whether the image's edge cuts it; None if too small."""
    polygon = polygon.astype(np.float32)
    area = cv2.contourArea(polygon)
    if area < LEAST_AREA:
        return None
    hull = cv2.contourArea(cv2.convexHull(polygon))
    _, sides, _ = cv2.minAreaRect(polygon)
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    cut = bool((low < 2).any() or high[0] > WIDTH - 3 or high[1] > height - 3)
    return np.sqrt(area) / WIDTH, area / hull, max(sides) / max(min(sides), 1e-6), cut


def collect(rows: list[tuple[int, str, bool, NDArray[np.float64]]], height: float) -> Outlines:
    """Measure every outline (image, class, reddened, polygon)."""
    kept = [(image, red, m) for image, _, red, p in rows if (m := measure(p, height)) is not None]
    names = [name for _, name, _, _ in rows]
    table = np.array([m for *_, m in kept], dtype=np.float64)
    return Outlines(
        image=np.array([image for image, *_ in kept]),
        red=np.array([red for _, red, _ in kept]),
        size=table[:, 0],
        solidity=table[:, 1],
        elongation=table[:, 2],
        cut=table[:, 3] > 0,
        classes={name: names.count(name) / len(names) for name in sorted(set(names))},
    )


def read_real(path: Path) -> tuple[Outlines, NDArray[np.float64]]:
    """The real outlines, and how many there are in each image."""
    with gzip.open(path, "rt") as file:
        data = json.load(file)
    scale = WIDTH / data["width"]
    rows, counts = [], []
    for number, image in enumerate(data["images"]):
        counts.append(len(image["instances"]))
        for instance in image["instances"]:
            polygons = [np.array(p, dtype=np.float64).reshape(-1, 2) for p in instance["polygons"]]
            largest = max(polygons, key=lambda p: cv2.contourArea(p.astype(np.float32)))
            red = instance["ripeness"] != "unripe"
            rows.append((number, instance["ripeness"], red, largest * scale))
    return collect(rows, data["height"] * scale), np.array(counts)


def read_simulated(
    folder: Path,
) -> tuple[Outlines, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """The simulated outlines, how many in each image, occlusion of each, grams of each ripe berry once."""
    from faster_coco_eval.core import mask as rasteriser

    data = json.loads((folder / "annotations.json").read_text())
    group = {image["id"]: image["group"] for image in data["images"]}
    rows, counts, weights = [], dict.fromkeys(group, 0), {}
    for annotation in data["annotations"]:
        contours, _ = cv2.findContours(
            rasteriser.decode(annotation["segmentation"]), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        largest = max(contours, key=cv2.contourArea)[:, 0].astype(np.float64)
        stage, number = annotation["stage"], annotation["image_id"]
        counts[number] += 1
        rows.append((number, stage, stage in RED_STAGES, largest))
        if stage == "ripe":
            weights[group[number], annotation["berry_id"]] = annotation["weight_g"]
    occlusion = np.array([annotation["occlusion"] for annotation in data["annotations"]])
    height = data["images"][0]["height"]
    return collect(rows, height), np.array(list(counts.values())), occlusion, np.array(list(weights.values()))


def read_weights(path: Path) -> NDArray[np.float64]:
    """Grams of each weighed berry once; names of its views differ in the split and in the last digit."""
    views = re.compile(r"split\d+|_\d+\.pcd$")
    with path.open() as file:
        weights = {views.sub("", row["pcd_file"]): float(row["weight"]) for row in csv.DictReader(file)}
    return np.array(list(weights.values()))


def unripe_sizes(outlines: Outlines) -> NDArray[np.float64]:
    """Size of each unripe fruit over the median of the reddened ones in its image."""
    whole = ~outlines.cut & (outlines.solidity > UNBROKEN)
    shares = []
    for image in np.unique(outlines.image):
        here = whole & (outlines.image == image)
        if (here & outlines.red).any():
            middle = np.median(outlines.size[here & outlines.red])
            shares.append(outlines.size[here & ~outlines.red] / middle)
    return np.concatenate(shares)


def overlap(one: NDArray[np.float64], other: NDArray[np.float64], edges: NDArray[np.float64]) -> float:
    """Common area of two histograms, 0 to 1; values beyond the edges count in the outer bins."""
    parts = [np.histogram(np.clip(v, edges[0], edges[-1]), edges)[0] / len(v) for v in (one, other)]
    return float(np.minimum(*parts).sum())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--simulated", type=Path, required=True)
    parser.add_argument("--real", type=Path, default=Path("../shared/data"))
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--sheet", type=Path, help="contact sheet of one plant in each kind of surroundings")
    options = parser.parse_args()
    real, real_counts = read_real(options.real / "strawdi_masks" / "train_polygons.json.gz")
    ours, our_counts, occlusion, our_weights = read_simulated(options.simulated)
    weights = read_weights(options.real / "dyson" / "berry_weights_g.csv")

    def shapes(outlines: Outlines, *, red: bool) -> NDArray[np.float64]:
        chosen = ~outlines.cut & (outlines.solidity > UNBROKEN) & (outlines.red == red)
        return np.asarray(outlines.elongation[chosen])

    panels = [
        ("elongation, reddened", shapes(real, red=True), shapes(ours, red=True), np.linspace(1, 2.2, 25)),
        ("elongation, unripe", shapes(real, red=False), shapes(ours, red=False), np.linspace(1, 2.2, 25)),
        ("size of unripe over reddened", unripe_sizes(real), unripe_sizes(ours), np.linspace(0, 1.6, 25)),
        ("solidity of the outline", real.solidity, ours.solidity, np.linspace(0.6, 1.0, 25)),
        ("berries an image", real_counts, our_counts, np.arange(0.5, 16.5)),
        ("weight of ripe berries, g", weights, our_weights, np.linspace(0, 42, 22)),
    ]
    print("| what | real: 5, 50, 95% | simulated | overlap |\n|---|---|---|---|")
    for name, one, other, edges in panels:
        texts = (" / ".join(f"{v:.2f}" for v in np.percentile(x, (5, 50, 95))) for x in (one, other))
        print(f"| {name} | {' | '.join(texts)} | {overlap(one, other, edges):.2f} |")
    print(
        f"\nweights: real {weights.mean():.1f} ± {weights.std():.1f} g (n = {len(weights)}), "
        f"simulated {our_weights.mean():.1f} ± {our_weights.std():.1f} g (n = {len(our_weights)})"
    )
    for name, outlines in (("real", real), ("simulated", ours)):
        print(f"{name}: " + ", ".join(f"{c} {share:.1%}" for c, share in outlines.classes.items()))
    print(
        "simulated occlusion, share of outlines over .1/.3/.5: "
        + ", ".join(f"{(occlusion > limit).mean():.1%}" for limit in (0.1, 0.3, 0.5))
    )
    if options.figure:
        draw(panels, options.figure)
    if options.sheet:
        draw_sheet(options.simulated, options.sheet)


def draw(
    panels: list[tuple[str, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]], path: Path
) -> None:
    """All distributions side by side, as one picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 5.4), layout="constrained", dpi=100)
    for axes, (name, one, other, edges) in zip(figure.subplots(2, 3).flat, panels, strict=True):
        for values, colour, label in ((one, "#7a8a99", "real"), (other, "#c8202f", "simulated")):
            inside = np.clip(values, edges[0], edges[-1])
            axes.hist(
                inside,
                edges,
                weights=np.full(len(values), 1 / len(values)),
                color=colour,
                alpha=0.5,
                label=label,
            )
        axes.set_title(name, fontsize=10)
        axes.set_yticks([])
        axes.spines[["top", "left", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False)
    figure.savefig(path)


def draw_sheet(folder: Path, path: Path) -> None:
    """Two plants in each kind of surroundings, the three views of each; the second plant's with their labels."""
    data = json.loads((folder / "annotations.json").read_text())
    plants: dict[str, list[str]] = {}
    for image in data["images"]:
        known = plants.setdefault(image["setting"], [])
        if image["group"] not in known:
            known.append(image["group"])
    rows = []
    for groups in plants.values():
        pictures = []
        for group, labelled in zip(groups[1:3], (False, True), strict=True):
            for image in (image for image in data["images"] if image["group"] == group):
                picture = cv2.imread(str(folder / image["file_name"]))
                if labelled:
                    for annotation in data["annotations"]:
                        if annotation["image_id"] == image["id"]:
                            draw_label(picture, annotation)
                pictures.append(cv2.resize(picture, (240, 180), interpolation=cv2.INTER_AREA))
        rows.append(np.hstack(pictures))
    cv2.imwrite(str(path), np.vstack(rows), [cv2.IMWRITE_JPEG_QUALITY, 82])


def draw_label(picture: NDArray[np.uint8], annotation: dict[str, Any]) -> None:
    """Outline (pluckable red, else yellow; crowd thin) and key-points: visible filled, else hollow."""
    from faster_coco_eval.core import mask as rasteriser

    mask = rasteriser.decode(annotation["segmentation"])
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    colour = (80, 40, 255) if annotation["category_id"] == 1 else (60, 220, 255)
    cv2.drawContours(picture, contours, -1, colour, 1 if annotation["iscrowd"] else 3)
    for u, v, flag in np.array(annotation["keypoints"]).reshape(5, 3):
        if flag:
            middle = (round(u), round(v))
            cv2.circle(picture, middle, 5, (255, 255, 255), -1 if flag == 2 else 2, cv2.LINE_AA)


if __name__ == "__main__":
    main()
