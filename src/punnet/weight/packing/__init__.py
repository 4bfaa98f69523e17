"""Punnets of one weight: each berry into the one where it serves best, by what is known of it before it is picked."""

from punnet.weight.packing.baselines import FillByCount, FirstFit
from punnet.weight.packing.berries import BerryPopulation, WeighedBerry
from punnet.weight.packing.look_ahead import LookAhead
from punnet.weight.packing.packer import Packer, PackingConfig, PackingPolicy, Punnet, Tally
from punnet.weight.packing.rule import AVERAGE_QUANTITY, MINIMUM_QUANTITY, PackingRule, RuleVerdict

__all__ = [
    "AVERAGE_QUANTITY",
    "MINIMUM_QUANTITY",
    "BerryPopulation",
    "FillByCount",
    "FirstFit",
    "LookAhead",
    "Packer",
    "PackingConfig",
    "PackingPolicy",
    "PackingRule",
    "Punnet",
    "RuleVerdict",
    "Tally",
    "WeighedBerry",
]
