"""How long something takes, as a multiple of something plain: a machine that is slow or busy slows down both."""

from __future__ import annotations

import time
from collections.abc import Callable

from threadpoolctl import threadpool_limits

__all__ = ["times_as_long"]


def times_as_long(work: Callable[[], object], plain: Callable[[], object], turns: int = 8) -> float:
    """Processor time of ``work`` over that of ``plain``: the quickest of several turns of each, one after the other.

    Linear algebra has one thread meanwhile: others, that wait for each other, would count too.
    """
    quickest = [float("inf"), float("inf")]
    with threadpool_limits(1):
        for _ in range(turns):
            for which, call in enumerate((work, plain)):
                begin = time.process_time()
                call()
                quickest[which] = min(quickest[which], time.process_time() - begin)
    return quickest[0] / quickest[1]
