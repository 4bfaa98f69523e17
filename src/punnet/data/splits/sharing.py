"""Share groups of images out among the parts of a split, so that no group straddles two."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from punnet.errors import PunnetError

__all__ = ["SplitError", "share_out"]


class SplitError(PunnetError):
    """A split that can't be made as asked."""


def share_out(
    groups: Sequence[Hashable],
    shares: Mapping[str, float],
    rng: np.random.Generator,
    *,
    strata: NDArray[np.float64] | None = None,
) -> dict[str, list[int]]:
    """Deal whole groups to the parts, each group to the part that is furthest behind its share.

    Groups are shuffled, then ordered by the mean of their strata (a stable sort), so each part gets its share of
    every stratum too. Sizes come out as asked to within the largest group.

    Parameters
    ----------
    groups
        The group of each image.
    shares
        Share of the images of each part, positive, summing to 1 (±1e-6).
    rng
        What shuffles.
    strata
        (N,) a number of each image by which parts should be alike, e.g. its count of ripe berries.

    Returns
    -------
    dict
        Indices of the images of each part, ascending.

    Raises
    ------
    SplitError
        If shares are not positive, do not sum to 1, or a part would stay empty.
    """
    if not shares or any(not share > 0 for share in shares.values()):
        raise SplitError(
            f"shares {dict(shares)} of the split: each must be above 0; leave out a part you don't want"
        )
    if abs(sum(shares.values()) - 1.0) > 1e-6:
        raise SplitError(
            f"shares {dict(shares)} of the split sum to {sum(shares.values()):g}; they must sum to 1"
        )
    members: dict[Hashable, list[int]] = {}
    for index, group in enumerate(groups):
        members.setdefault(group, []).append(index)
    order = [list(members.values())[i] for i in rng.permutation(len(members))]
    if strata is not None:
        order.sort(key=lambda indices: float(np.mean(strata[indices])))
    parts: dict[str, list[int]] = {name: [] for name in shares}
    dealt = 0
    for indices in order:
        dealt += len(indices)
        behind = {name: share * dealt - len(parts[name]) for name, share in shares.items()}
        parts[max(behind, key=lambda name: behind[name])] += indices
    if empty := [name for name, indices in parts.items() if not indices]:
        raise SplitError(
            f"{len(members)} group{'' if len(members) == 1 else 's'} of images can't fill the parts "
            f"{', '.join(shares)}: {', '.join(empty)} would be empty; ask for fewer parts or larger shares, "
            "or give more images"
        )
    return {name: sorted(indices) for name, indices in parts.items()}
