"""Speed and memory of a shipped detector against its peers, in one run on two cores at 640×480.

    python benchmarks/perception.py --bundle sim-fast --ultralytics ../yolo/bin/python

One image of a simulated plant goes in, boxes, masks and key-points of its berries come out:

* ours: `punnet.perception.LearnedDetector`, RGB to `Strawberries`;
* torchvision's `maskrcnn_resnet50_fpn`, eager, random weights: masks alone. "640×480" keeps the image's size, "as it comes"
  enlarges it to 800 rows, its default;
* YOLO11n-seg and YOLO11n-pose with two classes and five key-points, random weights, exported to ONNX and run by ONNX Runtime:
  what masks and key-points take there. The interpreter given by --ultralytics exports them; make it an environment of its own.

Random weights find nothing, so both peers are made to give as many detections as ours found: Mask R-CNN by its limit,
YOLO by taking its best boxes through non-maximum suppression and drawing that many masks. All take turns; the median counts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from punnet.bundle import load_bundle
from punnet.perception import LearnedDetector
from punnet.scene import Frame, read_image

Job = Callable[[], object]
SIZE = (480, 640)
MEGABYTE = 1024  # of the kB in /proc
CANDIDATES = 60
BARS = {"yolo_share": 1.0, "mask_rcnn_factor": 12.0, "peak_megabytes": 500.0}
EXPORT = """
import sys, yaml, ultralytics
from pathlib import Path
out = Path(sys.argv[1])
for task, kind in (("seg", "segment"), ("pose", "pose")):
    plan = Path(ultralytics.__file__).parent / f"cfg/models/11/yolo11-{task}.yaml"
    plan = yaml.safe_load(plan.read_text()) | {"nc": 2, "scale": "n"}
    if task == "pose":
        plan["kpt_shape"] = [5, 3]
    (out / f"yolo11n-{task}.yaml").write_text(yaml.safe_dump(plan))
    model = ultralytics.YOLO(str(out / f"yolo11n-{task}.yaml"), task=kind)
    model.export(format="onnx", imgsz=(480, 640), simplify=False)
"""
DRAW = """
import sys, cv2
from punnet.harvest.scenario import ORACLE, Scenario, Session
with Session(Scenario(int(sys.argv[1]), ORACLE)) as session:
    cv2.imwrite(sys.argv[2], session.robot.look().rgb[:, :, ::-1])
"""


class Yolo:
    """The two networks and the least that makes masks and key-points of what they give."""

    def __init__(self, folder: Path, threads: int, detections: int) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        self.sessions = [
            onnxruntime.InferenceSession(
                str(folder / f"yolo11n-{task}.onnx"), options, ["CPUExecutionProvider"]
            )
            for task in ("seg", "pose")
        ]
        self.detections = detections

    def detect(self, rgb: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Masks (N, H, W) and key-points (N, 5, 3)."""
        image = np.ascontiguousarray(rgb.transpose(2, 0, 1)[None], dtype=np.float32) / np.float32(255)
        (boxes, prototypes), (posed,) = (session.run(None, {"images": image}) for session in self.sessions)
        rows = self._best(boxes[0].T)
        low = prototypes[0].reshape(prototypes.shape[1], -1)
        small = (rows[:, 6:] @ low).reshape(len(rows), *prototypes.shape[2:])
        masks = np.stack([cv2.resize(mask, SIZE[::-1]) > 0 for mask in small])
        return masks, self._best(posed[0].T)[:, 6:].reshape(-1, 5, 3)

    def _best(self, rows: np.ndarray) -> np.ndarray:
        scores = rows[:, 4:6].max(axis=1)
        rows = rows[np.argpartition(-scores, CANDIDATES)[:CANDIDATES]]
        corners = np.concatenate((rows[:, :2] - rows[:, 2:4] / 2, rows[:, 2:4]), axis=1)
        cv2.dnn.NMSBoxes(corners.tolist(), rows[:, 4:6].max(axis=1).tolist(), 0.0, 0.7)
        return rows[: self.detections]


def simulated_image(seed: int, path: Path) -> np.ndarray:
    # A process of its own: Mesa's LLVM and the one in PyTorch's triton do not get on in one.
    subprocess.run([sys.executable, "-c", DRAW, str(seed), str(path)], check=True)
    return read_image(path)


def mask_rcnn(rgb: np.ndarray, threads: int, detections: int, **size: int) -> Job:
    import torch
    from torchvision.models.detection import maskrcnn_resnet50_fpn

    torch.set_num_threads(threads)
    torch.manual_seed(0)
    model = maskrcnn_resnet50_fpn(
        weights=None, weights_backbone=None, box_detections_per_img=detections, **size
    ).eval()

    def run() -> object:
        with torch.inference_mode():
            return model([torch.from_numpy(rgb).permute(2, 0, 1).float() / 255])

    return run


def export_yolo(interpreter: Path, folder: Path) -> None:
    subprocess.run(
        [interpreter, "-c", EXPORT, folder],
        check=True,
        cwd=folder,
        env=os.environ | {"YOLO_OFFLINE": "true", "YOLO_AUTOINSTALL": "false"},
        stdout=sys.stderr,
    )


def take_turns(jobs: dict[str, Job], rounds: int) -> dict[str, float]:
    """Median milliseconds of each job."""
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            # Threads of the one before may still be waiting for work on a core.
            time.sleep(0.05)
            repeats = 1 if times[name] and times[name][0] > 0.5 else 3
            if repeats > 1 or not times[name]:
                job()
            for _ in range(repeats):
                begin = time.perf_counter()
                job()
                times[name].append(time.perf_counter() - begin)
    return {name: 1000 * float(np.median(values)) for name, values in times.items()}


def peak_megabytes(bundle: str, image: Path, threads: int) -> float:
    """Peak resident memory of a fresh process that loads the detector and uses it ten times."""
    command = [sys.executable, __file__, "--bundle", bundle, "--threads", str(threads), "--image", str(image)]
    printed = subprocess.run([*command, "--memory-only"], check=True, capture_output=True, text=True).stdout
    return float(printed)


def print_own_peak(bundle: str, image: Path, threads: int) -> None:
    detector = LearnedDetector.from_bundle(bundle, threads=threads)
    frame = Frame(read_image(image))
    for _ in range(10):
        detector.detect(frame)
    lines = Path("/proc/self/status").read_text().splitlines()
    print(next(int(line.split()[1]) for line in lines if line.startswith("VmHWM:")) / MEGABYTE)


def measure(arguments: argparse.Namespace, folder: Path) -> dict[str, object]:
    picture = folder / "image.png"
    rgb = simulated_image(arguments.seed, picture) if arguments.image is None else read_image(arguments.image)
    rgb = np.ascontiguousarray(cv2.resize(rgb, SIZE[::-1], interpolation=cv2.INTER_AREA))
    cv2.imwrite(str(picture), rgb[:, :, ::-1])
    threads, frame = arguments.threads, Frame(rgb)
    ours = LearnedDetector.from_bundle(arguments.bundle, threads=threads)
    berries = len(ours.detect(frame))
    count = max(berries, 1)
    jobs: dict[str, Job] = {"ours": lambda: ours.detect(frame)}
    if arguments.ultralytics is not None:
        export_yolo(arguments.ultralytics, folder)
        yolo = Yolo(folder, threads, count)
        jobs["YOLO11n-seg + YOLO11n-pose"] = lambda: yolo.detect(rgb)
    jobs["Mask R-CNN R50-FPN, 640×480"] = mask_rcnn(rgb, threads, count, min_size=480, max_size=640)
    jobs["Mask R-CNN R50-FPN, as it comes"] = mask_rcnn(rgb, threads, count)
    times = take_turns(jobs, arguments.rounds)
    manifest = load_bundle(arguments.bundle).manifest
    return {
        "bundle": {"name": manifest.name, "version": manifest.version, "created": manifest.created},
        "backbone": ours.settings.backbone,
        "size": list(SIZE),
        "threads": threads,
        "berries_found": berries,
        "milliseconds": {name: round(value, 2) for name, value in times.items()},
        "times_as_long": {name: round(value / times["ours"], 3) for name, value in times.items()},
        "peak_megabytes": round(peak_megabytes(arguments.bundle, picture, threads), 1),
    }


def report(figures: dict[str, object]) -> None:
    milliseconds, ratios = figures["milliseconds"], figures["times_as_long"]
    assert isinstance(milliseconds, dict)
    assert isinstance(ratios, dict)
    print(
        f"bundle {figures['bundle']['name']} of {figures['bundle']['created']} ({figures['backbone']}), "  # type: ignore[index]
        f"{figures['threads']} threads, 640×480, {figures['berries_found']} berries"
    )
    for name, value in milliseconds.items():
        print(f"  {name:32} {value:8.1f} ms   {ratios[name]:6.2f} × ours")
    print(f"  peak memory of a fresh process   {figures['peak_megabytes']:8.0f} MB")
    if "YOLO11n-seg + YOLO11n-pose" in ratios:
        share = 1 / ratios["YOLO11n-seg + YOLO11n-pose"]
        say("share of the YOLO pair's time", share, share <= BARS["yolo_share"], f"≤ {BARS['yolo_share']}")
    factor = ratios["Mask R-CNN R50-FPN, 640×480"]
    say("faster than Mask R-CNN", factor, factor >= BARS["mask_rcnn_factor"], f"≥ {BARS['mask_rcnn_factor']}")
    peak = figures["peak_megabytes"]
    assert isinstance(peak, float)
    say("peak memory, MB", peak, peak <= BARS["peak_megabytes"], f"≤ {BARS['peak_megabytes']}")


def say(what: str, value: float, reached: bool, bar: str) -> None:
    print(f"  {what:32} {value:8.2f}      bar {bar}: {'reached' if reached else 'missed'}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="sim-fast", help="name or folder [%(default)s]")
    parser.add_argument(
        "--ultralytics", type=Path, help="python with the package ultralytics; without it no YOLO"
    )
    parser.add_argument("--image", type=Path, help="a photograph instead of a simulated plant")
    parser.add_argument("--seed", type=int, default=23, help="of the plant [%(default)s]")
    parser.add_argument("--threads", type=int, default=2, help="for everybody [%(default)s]")
    parser.add_argument("--rounds", type=int, default=12, help="turns that each takes [%(default)s]")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of the table")
    parser.add_argument("--memory-only", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    cv2.setNumThreads(arguments.threads)
    if arguments.memory_only:
        print_own_peak(arguments.bundle, arguments.image, arguments.threads)
        return
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(arguments, Path(folder))
    if arguments.json:
        print(json.dumps(figures, indent=2, ensure_ascii=False))
    else:
        report(figures)


if __name__ == "__main__":
    main()
