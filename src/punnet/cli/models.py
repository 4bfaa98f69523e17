"""``punnet models``: the bundles that can be used, and whether they are whole."""

from __future__ import annotations

import json
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
    folder: Annotated[
        Path | None, typer.Argument(help="Folder of bundles; without it those that come with punnet.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List model bundles and check every file against its SHA-256 sum.

    A damaged bundle is said so and makes the exit code 1.
    """
    from punnet.bundle import load_bundle
    from punnet.bundle.bundle import SHIPPED_FOLDER
    from punnet.bundle.manifest import MANIFEST_FILE

    root = SHIPPED_FOLDER if folder is None else folder
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
            _print(bundle)
        say(f"{len(bundles)} in {root}, every file as its SHA-256 sum says")
    if len(bundles) < len(manifests):
        raise typer.Exit(1)


def _facts(bundle: Bundle) -> dict[str, Any]:
    size = sum(path.stat().st_size for path in bundle.folder.rglob("*") if path.is_file())
    return bundle.manifest.to_json() | {"folder": str(bundle.folder), "bytes": size}


def _print(bundle: Bundle) -> None:
    facts = _facts(bundle)
    rows = [
        ("kind", facts["kind"]),
        ("version", f"{facts['version']} of {facts['created']}"),
        ("licence", facts["licence"]),
        *((name, facts[name]) for name in ("restriction", "citation") if facts[name]),
        ("size", f"{facts['bytes'] / 1024:.0f} KiB"),
        ("made by", facts["command"]),
        *_flat(facts["results"]),
    ]
    print_table(bundle.name, ("", ""), rows)


def _flat(results: dict[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    rows = []
    for name, value in results.items():
        label = f"{prefix}{name}"
        if isinstance(value, dict):
            rows += _flat(value, f"{label}.")
        else:
            rows.append((label, value if isinstance(value, str) else json.dumps(value)))
    return rows
