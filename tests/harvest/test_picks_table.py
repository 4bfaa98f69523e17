"""The Parquet table of picks, read back by an independent reader."""

from pathlib import Path

import pytest

from punnet.errors import ConfigurationError
from punnet.harvest import picks_table as module
from punnet.harvest.picks_table import picks_table, write_picks
from punnet.harvest.records import PickRecord

PICKS = (
    PickRecord(1, "pluckable", "picked", estimate_g=22.0, interval_g=(17.0, 27.5), weighed_g=20.4, punnet=1),
    PickRecord(2, "pluckable", "failed", "grip: nothing between the pads", estimate_g=float("nan")),
)


def test_a_row_an_attempt(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = write_picks(tmp_path / "picks.parquet", PICKS)
    rows = parquet.read_table(path).to_pylist()
    assert [row["outcome"] for row in rows] == ["picked", "failed"]
    assert rows[0]["estimate_low_g"] == 17.0
    assert rows[0]["weighed_g"] == 20.4
    assert rows[1]["reason"] == "grip: nothing between the pads"
    assert rows[1]["estimate_g"] is None


def test_a_harvest_without_picks_has_a_table_too(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    assert picks_table(()).num_rows == 0


def test_without_pyarrow_it_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "parquet_is_there", lambda: False)
    assert write_picks(tmp_path / "picks.parquet", PICKS) is None
    assert list(tmp_path.iterdir()) == []

    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(module.importlib, "import_module", missing)
    with pytest.raises(ConfigurationError, match=r"pip install 'punnet\[lerobot\]'"):
        picks_table(PICKS)
