"""``punnet models``: the bundles that can be used, and whether they are whole."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from punnet.cli.console import note, print_json, print_table, say
from punnet.cli.options import Json
from punnet.errors import BundleError

if TYPE_CHECKING:
    from punnet.bundle import Bundle

__all__ = ["register"]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: punnet models --json")(models)


def models(
    what: Annotated[
        str | None,
        typer.Argument(
            help="A bundle, by name or folder: how it was made and what it was measured to do. Or a folder of bundles; without "
            "it those that come with punnet.",
            show_default=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List model bundles and check every file against its SHA-256 sum.

    A damaged bundle is said so and makes the exit code 1.
    """
    from punnet.bundle import load_bundle
    from punnet.bundle.bundle import SHIPPED_FOLDER
    from punnet.bundle.manifest import MANIFEST_FILE

    root = SHIPPED_FOLDER if what is None else Path(what)
    if what is not None and ((root / MANIFEST_FILE).is_file() or not root.is_dir()):
        bundle = load_bundle(what)
        if as_json:
            print_json(_facts(bundle))
        else:
            _print(bundle, [("made by", bundle.manifest.command), *_flat(bundle.manifest.results)])
        return
    manifests = sorted(root.glob(f"*/{MANIFEST_FILE}"))
    if not manifests:
        raise BundleError(f"{root}: no bundles here; a bundle is a folder with {MANIFEST_FILE}")
    bundles = []
    for manifest in manifests:
        try:
            bundles.append(load_bundle(manifest.parent))
        except BundleError as error:
            note(f"damaged: {error}")
    if as_json:
        print_json([_facts(bundle) for bundle in bundles])
    else:
        for bundle in bundles:
            _print(bundle, [])
        say(
            f"{len(bundles)} in {root}, every file as its SHA-256 sum says; punnet models NAME tells all about one"
        )
    if len(bundles) < len(manifests):
        raise typer.Exit(1)


def _facts(bundle: Bundle) -> dict[str, Any]:
    size = sum(path.stat().st_size for path in bundle.folder.rglob("*") if path.is_file())
    return bundle.manifest.to_json() | {"folder": str(bundle.folder), "bytes": size}


def _print(bundle: Bundle, more: list[tuple[str, str]]) -> None:
    facts = _facts(bundle)
    rows = [
        ("kind", facts["kind"]),
        ("version", f"{facts['version']} of {facts['created']}"),
        ("licence", facts["licence"]),
        *((name, facts[name]) for name in ("restriction", "citation") if facts[name]),
        ("size", f"{facts['bytes'] / 1024:.0f} KiB"),
        *more,
    ]
    print_table(bundle.name, ("", ""), rows)


def _flat(results: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """A row a number or a few that belong together, named by the way to it."""
    rows = []
    for name, found in results.items():
        label, value = f"{prefix}{name}", found
        if isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            value = {_name(item, index): item for index, item in enumerate(value, 1)}
        if isinstance(value, dict) and any(isinstance(item, dict | list) for item in value.values()):
            rows += _flat(value, f"{label}: ")
        elif isinstance(value, dict):
            rows.append((label, ", ".join(f"{key} {_text(item)}" for key, item in value.items())))
        else:
            rows.append((label, _text(value)))
    return rows


def _name(item: dict[str, Any], index: int) -> str:
    """Take the word that an entry of a list begins with out of it, or its number."""
    first = next(iter(item), None)
    return str(item.pop(first)) if first is not None and isinstance(item[first], str) else str(index)


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_text, value))
    return value if isinstance(value, str) else json.dumps(value)
