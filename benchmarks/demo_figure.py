"""The README's first picture: what the camera found, a cut, and a moment of the film of a harvest.

make demo && python benchmarks/demo_figure.py runs/demo --out docs/figures/demo.jpg
"""

from __future__ import annotations

import argparse
import base64
import re
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

HEIGHT = 450
GAP = 6
_CUT = re.compile(r'<img[^>]*?src="data:image/[a-z]+;base64,([A-Za-z0-9+/=]+)"[^>]*?alt="at the cut"')


def main() -> None:
    """Put the three side by side."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, help="folder that punnet demo or punnet harvest wrote")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--pick", type=int, default=2, help="whose cut is shown")
    parser.add_argument("--moment", type=float, default=0.62, help="of the film, 0 to 1")
    arguments = parser.parse_args()
    panels = [
        cv2.imread(str(arguments.run / "first_view.png")),
        cut(arguments.run / "report.html", arguments.pick),
        moment(arguments.run / "harvest.mp4", arguments.moment),
    ]
    gap = np.full((HEIGHT, GAP, 3), 255, dtype=np.uint8)
    scaled = [cv2.resize(p, (round(p.shape[1] * HEIGHT / p.shape[0]), HEIGHT)) for p in panels]
    cv2.imwrite(str(arguments.out), np.hstack([scaled[0], gap, scaled[1], gap, scaled[2]]))


def cut(report: Path, pick: int) -> NDArray[np.uint8]:
    """The report's picture of a pick at the cut."""
    found = _CUT.findall(report.read_text())
    return np.asarray(cv2.imdecode(np.frombuffer(base64.b64decode(found[pick - 1]), np.uint8), 1))


def moment(film: Path, share: float) -> NDArray[np.uint8]:
    """A frame of the film."""
    video = cv2.VideoCapture(str(film))
    video.set(cv2.CAP_PROP_POS_FRAMES, int(share * video.get(cv2.CAP_PROP_FRAME_COUNT)))
    return np.asarray(video.read()[1])


if __name__ == "__main__":
    main()
