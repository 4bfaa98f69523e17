import json
from pathlib import Path
from typing import Any

import pytest

from punnet.bundle import Bundle, list_bundles, load_bundle, write_bundle
from punnet.errors import BundleError, OutputExistsError

DETAILS: dict[str, Any] = {
    "name": "toy",
    "kind": "promp",
    "licence": "Apache-2.0",
    "command": "punnet demos simulate --bundle toy",
    "seed": 3,
    "data": {"source": "nowhere"},
    "results": {"error_m": 0.02},
}


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    write_bundle(
        tmp_path / "toy", files={"promp.json": {"a": [1, 2]}, "nets/net.onnx": b"\x08\x01"}, **DETAILS
    )
    return tmp_path / "toy"


def change_manifest(folder: Path, **changes: object) -> None:
    path = folder / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def test_round_trip(bundle: Path) -> None:
    loaded = load_bundle(bundle, kind="promp")
    assert (loaded.name, loaded.kind, loaded.manifest.seed) == ("toy", "promp", 3)
    assert loaded.read_json("promp.json") == {"a": [1, 2]}
    assert loaded.path("nets/net.onnx").read_bytes() == b"\x08\x01"
    assert loaded.manifest.results == {"error_m": 0.02}
    assert [manifest.name for manifest in list_bundles(bundle.parent)] == ["toy"]
    assert json.loads((bundle / "manifest.json").read_text())["schema"] == "punnet-bundle/1"


def test_shipped_bundles_all_verify_by_name() -> None:
    shipped = list_bundles()
    assert "promp-reach-sim" in {manifest.name for manifest in shipped}
    for manifest in shipped:
        assert load_bundle(manifest.name).manifest == manifest


def test_changed_file_is_refused(bundle: Path) -> None:
    (bundle / "promp.json").write_text("{}")
    with pytest.raises(BundleError, match=r"promp\.json: checksum is"):
        load_bundle(bundle)


def test_missing_file_is_refused(bundle: Path) -> None:
    (bundle / "nets" / "net.onnx").unlink()
    with pytest.raises(BundleError, match=r"'nets/net\.onnx' of the manifest is missing"):
        load_bundle(bundle)


def test_unknown_schema_version_is_refused(bundle: Path) -> None:
    change_manifest(bundle, schema="punnet-bundle/2")
    with pytest.raises(BundleError, match="'punnet-bundle/2' is unknown"):
        load_bundle(bundle)


def test_wrong_kind_is_refused(bundle: Path) -> None:
    with pytest.raises(BundleError, match="of kind 'promp'; 'detector' is needed"):
        load_bundle(bundle, kind="detector")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"files": {"../secret.json": "0" * 64}}, "leaves the bundle"),
        ({"files": {"/etc/x.json": "0" * 64}}, "leaves the bundle"),
        ({"files": {"model.pkl": "0" * 64}}, "must end in"),
        ({"files": {"promp.json": "abc"}}, "64 hexadecimal"),
        ({"files": []}, "must be an object"),
        ({"seed": "three"}, "seed"),
        ({"name": ""}, "'name'"),
        ({"surprise": 1}, r"unknown \['surprise'\]"),
    ],
)
def test_damaged_manifests_are_refused(bundle: Path, changes: dict[str, object], message: str) -> None:
    change_manifest(bundle, **changes)
    with pytest.raises(BundleError, match=message):
        load_bundle(bundle)


def test_not_a_bundle(tmp_path: Path, bundle: Path) -> None:
    with pytest.raises(BundleError, match="neither a folder nor a bundle"):
        load_bundle("no-such-model")
    with pytest.raises(BundleError, match=r"has no manifest\.json"):
        load_bundle(tmp_path)
    (bundle / "manifest.json").write_text("{ broken")
    with pytest.raises(BundleError, match="not readable as JSON"):
        load_bundle(bundle)
    (bundle / "manifest.json").write_text("[]")
    with pytest.raises(BundleError, match="not a bundle manifest"):
        load_bundle(bundle)
    with pytest.raises(BundleError, match="no such folder"):
        list_bundles(tmp_path / "nowhere")


def test_existing_output_needs_force_and_force_replaces_only_bundles(tmp_path: Path, bundle: Path) -> None:
    with pytest.raises(OutputExistsError, match="--force"):
        write_bundle(bundle, files={"new.json": 1}, **DETAILS)
    write_bundle(bundle, files={"new.json": 1}, force=True, **DETAILS)
    assert sorted(path.name for path in bundle.iterdir()) == ["manifest.json", "new.json"]
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "a.jpg").write_bytes(b"x")
    with pytest.raises(OutputExistsError, match="not made by punnet"):
        write_bundle(tmp_path / "photos", files={}, force=True, **DETAILS)
    assert (tmp_path / "photos" / "a.jpg").exists()


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"model.pkl": b""}, "must end in"),
        ({"../x.json": 1}, "leaves the bundle"),
        ({"manifest.json": {}}, "not be the manifest"),
        ({"a.json": float("nan")}, "as JSON"),
        ({"a.json": {1, 2}}, "as JSON"),
        ({"a.json": Path("/no/such/file.json")}, "can't be written"),
    ],
)
def test_failed_write_leaves_the_old_bundle_and_no_litter(
    bundle: Path, files: dict[str, Any], message: str
) -> None:
    with pytest.raises(BundleError, match=message):
        write_bundle(bundle, files=files, force=True, **DETAILS)
    assert load_bundle(bundle).read_json("promp.json") == {"a": [1, 2]}
    assert [path.name for path in bundle.parent.iterdir()] == ["toy"]


def test_asking_for_an_unknown_file(bundle: Path) -> None:
    loaded: Bundle = load_bundle(bundle)
    with pytest.raises(BundleError, match=r"no file 'x\.json'; it has"):
        loaded.path("x.json")
    with pytest.raises(BundleError, match="not readable as JSON"):
        loaded.read_json("nets/net.onnx")


def test_restriction_and_citation_are_kept_and_may_be_left_out(tmp_path: Path) -> None:
    said = {"restriction": "non-commercial use only", "citation": "A. Author: Berries, 2020"}
    manifest = write_bundle(tmp_path / "bound", files={"a.json": {}}, **DETAILS, **said)
    assert load_bundle(tmp_path / "bound").manifest == manifest
    assert (manifest.restriction, manifest.citation) == tuple(said.values())
    path = tmp_path / "bound" / "manifest.json"
    older = {key: value for key, value in json.loads(path.read_text()).items() if key not in said}
    path.write_text(json.dumps(older))
    assert load_bundle(tmp_path / "bound").manifest.restriction == ""
    change_manifest(tmp_path / "bound", restriction=None)
    with pytest.raises(BundleError, match="'restriction' must be a text"):
        load_bundle(tmp_path / "bound")
