"""Splits of a set of images into parts that share no plant."""

from punnet.data.splits.part import choose_part
from punnet.data.splits.sharing import SplitError, share_out
from punnet.data.splits.splitting import Split, apply_split, read_split, split_dataset, write_split
from punnet.data.splits.strawdi import strawdi_split

__all__ = [
    "Split",
    "SplitError",
    "apply_split",
    "choose_part",
    "read_split",
    "share_out",
    "split_dataset",
    "strawdi_split",
    "write_split",
]
