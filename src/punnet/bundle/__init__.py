"""Models on disk: a folder with ``manifest.json`` and JSON or ONNX files. Nothing is ever unpickled."""

from punnet.bundle.bundle import Bundle, list_bundles, load_bundle
from punnet.bundle.graph import Graph
from punnet.bundle.manifest import BUNDLE_SCHEMA, Manifest
from punnet.bundle.writing import require_bundle_place, write_bundle

__all__ = [
    "BUNDLE_SCHEMA",
    "Bundle",
    "Graph",
    "Manifest",
    "list_bundles",
    "load_bundle",
    "require_bundle_place",
    "write_bundle",
]
