"""Fixtures that every room's tests share."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import numpy as np
import pytest

os.environ.setdefault("MPLBACKEND", "agg")

# PyTorch and Mesa's software renderer both bring LLVM: loaded after a picture was rendered, PyTorch crashes (triton).
with contextlib.suppress(ImportError):
    import torch  # noqa: F401
    import torchvision  # noqa: F401


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of local data beside the checkout (``../shared/data``); the test is skipped, saying so, without it."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"LOCAL DATA ABSENT: {folder} is not there; this check against real data did not run")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20261122)
