"""The whole loop, from a look to a punnet: run it, judge it, measure it, tell it."""

from punnet.harvest.attempts import Attempt, HarvestRun, Outcome, Phase
from punnet.harvest.benchmark import BenchmarkResult, BenchmarkSettings, run_benchmark
from punnet.harvest.config import HarvestConfig
from punnet.harvest.judge import Fate
from punnet.harvest.loop import Harvester
from punnet.harvest.records import HarvestReport
from punnet.harvest.scenario import Scenario, Session
from punnet.harvest.session_folder import harvest_into

__all__ = [
    "Attempt",
    "BenchmarkResult",
    "BenchmarkSettings",
    "Fate",
    "HarvestConfig",
    "HarvestReport",
    "HarvestRun",
    "Harvester",
    "Outcome",
    "Phase",
    "Scenario",
    "Session",
    "harvest_into",
    "run_benchmark",
]
