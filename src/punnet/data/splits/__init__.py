"""Splits of a set of images into parts that share no plant."""

from punnet.data.splits.sharing import SplitError, share_out
from punnet.data.splits.strawdi import strawdi_split

__all__ = ["SplitError", "share_out", "strawdi_split"]
