"""The picks of a harvest as one Parquet table, for pandas, Polars, DuckDB or R."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from punnet.errors import ConfigurationError
from punnet.harvest.durable import write_durably
from punnet.harvest.records import PickRecord

__all__ = ["PARQUET_EXTRA", "parquet_is_there", "picks_table", "write_picks"]

PARQUET_EXTRA = "pip install 'punnet[lerobot]'"
"""How to get pyarrow, which the table needs and nothing else of a harvest does."""

_FLOATS = (
    "estimate_g",
    "estimate_low_g",
    "estimate_high_g",
    "weighed_g",
    "true_g",
    "seconds_simulated",
    "seconds_computing",
)


def parquet_is_there() -> bool:
    """Whether pyarrow is installed."""
    return importlib.util.find_spec("pyarrow") is not None


def picks_table(picks: Sequence[PickRecord]) -> Any:
    """A ``pyarrow.Table`` with a row an attempt: the fields of :meth:`PickRecord.to_json`, the interval as two columns.

    Raises
    ------
    ConfigurationError
        If pyarrow is not installed.
    """
    arrow = _arrow("pyarrow")
    rows = []
    for pick in picks:
        row = pick.to_json()
        low, high = row.pop("interval_g") or (None, None)
        rows.append(row | {"estimate_low_g": low, "estimate_high_g": high})
    fields = [("id", arrow.int64()), ("class", arrow.string()), ("outcome", arrow.string())]
    fields += [("reason", arrow.string()), ("punnet", arrow.int64())]
    fields += [(name, arrow.float64()) for name in _FLOATS]
    return arrow.Table.from_pylist(rows, schema=arrow.schema(fields))


def write_picks(path: Path, picks: Sequence[PickRecord]) -> Path | None:
    """Write :func:`picks_table`, whole or not at all; None without pyarrow, when nothing is written."""
    if not parquet_is_there():
        return None
    sink = _arrow("pyarrow").BufferOutputStream()
    _arrow("pyarrow.parquet").write_table(picks_table(picks), sink)
    write_durably(path, sink.getvalue().to_pybytes())
    return path


def _arrow(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ConfigurationError(f"the table of picks needs pyarrow: {PARQUET_EXTRA}") from error
