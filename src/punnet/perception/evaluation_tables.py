"""An evaluation file in words: the tables that ``punnet evaluate detector`` prints."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["EvaluationTable", "percent", "tables_of_evaluation"]

EvaluationTable = tuple[str, tuple[str, ...], list[tuple[str, ...]]]
"""Title, columns (those that end in ``>`` are numbers), rows."""
NOTHING = "–"


def tables_of_evaluation(data: Mapping[str, Any]) -> list[EvaluationTable]:
    """Tables of what :meth:`punnet.perception.evaluation.Evaluation.to_json` gave; empty ones are left out."""
    tables = [_average_precision(data["classes"]), _keypoint_errors(data["keypoint_errors"])]
    confusions = (
        ("class_confusion", f"as found, from score {data['user_score']:g}"),
        ("stage_confusion", "colour stage, as found"),
        ("visibility", "key-points, as found"),
    )
    for name, title in confusions:
        if data[name] is not None:
            tables.append(_confusion(title, data[name]))
    tables += [
        _found("found, by √(mask area) in pixels", data["found_by_size"]),
        _found("found, by share hidden by something else", data["found_by_occlusion"]),
    ]
    return [table for table in tables if table[2]]


def percent(value: float | None) -> str:
    """A share in percent; a dash for None."""
    return NOTHING if value is None else f"{100 * value:.1f}"


def _average_precision(classes: Sequence[Mapping[str, Any]]) -> EvaluationTable:
    first = classes[0]
    masks = [f"mask {threshold}>" for threshold in first["mask_ap"]]
    points = [f"key-point {threshold}>" for threshold in first["keypoint_ap"]]
    columns = ("class", "annotated>", "found>", *masks, ".5:.95>", "AR>", *points, ".5:.95>", "AR>")
    rows: list[tuple[str, ...]] = []
    for row in classes:
        values = [*row["mask_ap"].values(), row["mask_ap_50_95"], row["mask_ar_50_95"]]
        values += [*row["keypoint_ap"].values(), row["keypoint_ap_50_95"], row["keypoint_ar_50_95"]]
        rows.append((row["class"], str(row["truths"]), str(row["detections"]), *map(percent, values)))
    return "average precision at IoU and OKS, and recall, in percent", columns, rows


def _keypoint_errors(errors: Sequence[Mapping[str, Any]]) -> EvaluationTable:
    columns = ("key-point", "berries", "shown", "located>")
    spreads = ("px median>", "mean>", "90%>", "% of size>", "mm median>", "mean>", "90%>")
    rows: list[tuple[str, ...]] = []
    for row in errors:
        pixels, millimetres = _spread(row["pixels"]), _spread(row["millimetres"])
        share = row["share_of_size"]
        rows.append(
            (
                row["keypoint"].replace("_", " "),
                row["berries"],
                row["shown"],
                f"{row['located']} of {row['annotated']}",
                *pixels,
                NOTHING if share is None else f"{100 * share['median']:.1f}",
                *millimetres,
            )
        )
    return "errors of key-points, of the berries that were found", (*columns, *spreads), rows


def _spread(spread: Mapping[str, float] | None) -> tuple[str, str, str]:
    if spread is None:
        return NOTHING, NOTHING, NOTHING
    return f"{spread['median']:.1f}", f"{spread['mean']:.1f}", f"{spread['ninety_percent']:.1f}"


def _confusion(title: str, confusion: Mapping[str, Any]) -> EvaluationTable:
    accuracy = confusion.get("accuracy", math.nan)
    if confusion["rows"] == confusion["columns"] and math.isfinite(accuracy):
        title += f"; {100 * accuracy:.1f}% right"
    rows = [
        (name, *map(str, counts)) for name, counts in zip(confusion["rows"], confusion["counts"], strict=True)
    ]
    return title, ("annotated", *(f"{column}>" for column in confusion["columns"])), rows


def _found(title: str, shares: Sequence[Mapping[str, Any]]) -> EvaluationTable:
    rows: list[tuple[str, ...]] = [
        (
            f"{share['from']:g} or more" if share["to"] is None else f"{share['from']:g}…{share['to']:g}",
            str(share["berries"]),
            percent(share["found"]),
            percent(share["rightly_named"]),
        )
        for share in shares
    ]
    return title, ("", "berries>", "found %>", "and rightly named %>"), rows
