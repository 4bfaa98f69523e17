import sys

import pytest

from punnet.errors import ConfigurationError
from punnet.sim.workers import require_backend, run_jobs


def _double(number):
    return 2 * number


@pytest.mark.parametrize("workers", [1, 2])
def test_every_job_is_done_once(workers):
    assert sorted(run_jobs(_double, [(n,) for n in range(5)], workers)) == [0, 2, 4, 6, 8]


def test_an_unknown_backend_is_named():
    with pytest.raises(ConfigurationError, match="threads"):
        require_backend("test", "threads")


def test_ray_that_is_not_there_is_asked_for(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray.util.joblib", None)
    with pytest.raises(ConfigurationError, match=r"punnet\[scale\]"):
        require_backend("test", "ray")
