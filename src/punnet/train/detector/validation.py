"""How good a network is between epochs: what it finds in whole images, decoded as the runtime decodes it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from punnet.data.dataset import AnnotatedImage
from punnet.perception.comparing import truth_of_image
from punnet.perception.decoding import decode_detections
from punnet.perception.learned import DetectorSettings, prepare
from punnet.perception.metrics import KEYPOINT_SIGMAS, DetectionScores, evaluate_detections
from punnet.perception.network import RawDetections
from punnet.scene import Strawberries, read_image
from punnet.train.detector.config import DetectorConfig
from punnet.train.detector.export import OUTPUTS, OnnxGraph
from punnet.train.detector.network import LEAST_SCORE, BerryDetector

__all__ = ["TorchNetwork", "detector_settings", "score_network"]

STRIDE = 32


def detector_settings(config: DetectorConfig) -> DetectorSettings:
    """What a bundle says of a network of this config."""
    return DetectorSettings(
        backbone=config.backbone,
        longest_side=config.longest_side,
        stride=STRIDE,
        mask_threshold=0.5,
        score_threshold=0.4,
        keypoint_sigmas=KEYPOINT_SIGMAS,
    )


class TorchNetwork:
    """A network in PyTorch behind the interface of the exported one."""

    def __init__(self, network: BerryDetector) -> None:
        self.graph = OnnxGraph(network).eval()

    def run(self, image: NDArray[np.uint8], score_threshold: float) -> RawDetections:
        """Detections of an image (1, H, W, 3), best first."""
        device = next(self.graph.parameters()).device
        with torch.no_grad():
            outputs = self.graph(
                torch.from_numpy(image).to(device), torch.tensor(score_threshold, device=device)
            )
        values = [(o.float() if o.is_floating_point() else o).cpu().numpy() for o in outputs]
        return RawDetections.from_outputs(dict(zip(OUTPUTS, values, strict=True)), image, "network")


def score_network(network: BerryDetector, images: Sequence[AnnotatedImage]) -> DetectionScores:
    """Scores of a network on whole images."""
    runner, settings = TorchNetwork(network), detector_settings(network.config)

    def found(image: AnnotatedImage) -> Strawberries:
        rgb = read_image(image.path)
        pixels, size = prepare(rgb, settings.longest_side, settings.stride)
        return decode_detections(
            runner.run(pixels, LEAST_SCORE),
            size,
            (rgb.shape[0], rgb.shape[1]),
            settings.mask_threshold,
            settings.keypoint_sigmas,
            least_score=LEAST_SCORE,
            unsure_below=settings.score_threshold,
        )

    return evaluate_detections((truth_of_image(image)[0] for image in images), map(found, images))
