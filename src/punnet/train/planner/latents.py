"""How well latent vectors of one target's photographs keep together: t-SNE and Davies–Bouldin, as table 6.4 and fig. 6.14."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from punnet.errors import ShapeError

__all__ = ["embedding", "separability"]

Array = NDArray[np.float64]
PERPLEXITY = 30.0


def embedding(latents: Array, seed: int) -> Array:
    """t-SNE of latent vectors (N, K) to the plane: (N, 2).

    Raises
    ------
    ShapeError
        If there are fewer than four vectors.
    """
    from sklearn.manifold import TSNE

    if latents.ndim != 2 or len(latents) < 4:
        raise ShapeError(f"latents: at least four vectors (N, K) are needed, got {latents.shape}")
    perplexity = min(PERPLEXITY, (len(latents) - 1) / 3.0)
    return np.asarray(
        TSNE(perplexity=perplexity, init="pca", random_state=seed).fit_transform(latents), dtype=np.float64
    )


def separability(latents: Array, targets: NDArray[np.int64], seed: int) -> tuple[float, float]:
    """Davies–Bouldin score by target after t-SNE, as the thesis has it, and of the vectors themselves; lower is better.

    Parameters
    ----------
    latents
        (N, K)
    targets
        (N,) whose photograph each is.
    seed
        Of t-SNE.

    Raises
    ------
    ShapeError
        If there is one target only, or as many as vectors.
    """
    from sklearn.metrics import davies_bouldin_score

    if not 1 < len(np.unique(targets)) < len(targets):
        raise ShapeError("latents: several targets with several photographs each are needed")
    return (
        float(davies_bouldin_score(embedding(latents, seed), targets)),
        float(davies_bouldin_score(latents, targets)),
    )
