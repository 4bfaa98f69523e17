"""The page answers what it has, to this machine only, and nothing that lies outside of the gallery."""

from __future__ import annotations

import http.client
import json
import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from punnet.data.gallery import Gallery, open_gallery, open_images
from punnet.data.viewer import HOST, GalleryServer
from punnet.errors import ConfigurationError, FileFormatError


@contextmanager
def served(gallery: Gallery) -> Iterator[GalleryServer]:
    with GalleryServer(gallery) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def ask(
    server: GalleryServer, address: str, host: str | None = None, method: str = "GET"
) -> tuple[int, bytes, Any]:
    connection = http.client.HTTPConnection(HOST, server.server_address[1], timeout=10)
    connection.putrequest(method, address, skip_host=True)
    connection.putheader("Host", host or f"{HOST}:{server.server_address[1]}")
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body, answer.headers


@pytest.fixture
def damaged(coco: dict[str, Any], coco_file: Callable[[dict[str, Any]], Path]) -> Path:
    """A set with a berry that can't be read, one with a wrong area, and a photograph that is missing."""
    coco["annotations"].insert(0, {**coco["annotations"][0], "id": 70, "bbox": [1, 2]})
    coco["annotations"][2]["area"] = 7
    coco["images"][1]["file_name"] = "<b>gone</b>.png"
    return coco_file(coco)


def test_a_gallery_of_a_damaged_set(damaged: Path) -> None:
    gallery = open_gallery(damaged)
    first, second = gallery.items
    assert gallery.left_out == 1
    assert first.summary() == {
        "name": "a.png",
        "classes": {"pluckable": 1, "unpluckable": 1},
        "crowd": 0,
        "faults": ["area-mismatch", "bad-box"],
    }
    assert second.summary()["faults"] == ["missing-image"]
    rows = first.details()["berries"]
    assert rows[0]["key-points"] == "×●●○●"
    assert rows[0]["grams"] == 18.5
    assert {problem["annotation_id"] for problem in first.details()["problems"]} == {70, 2}


def test_bare_photographs(photographs: Path, tmp_path: Path) -> None:
    (photographs / "c.jpg").write_text("no photograph")
    gallery = open_gallery(photographs)
    assert [item.path.name for item in gallery.items] == ["a.png", "b.png", "c.jpg"]
    assert gallery.items[0].details()["berries"] == []
    dataset, left_out = open_images(photographs)
    assert [image.path.name for image in dataset] == ["a.png", "b.png"]
    assert len(left_out) == 1
    with served(gallery) as server:
        assert ask(server, "/thumb/0.jpg")[0] == 200
        assert ask(server, "/thumb/2.jpg")[0] == 422
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileFormatError, match="empty"):
        open_gallery(tmp_path / "empty")


def test_what_is_served(damaged: Path) -> None:
    gallery = open_gallery(damaged)
    with served(gallery) as server:
        status, page, headers = ask(server, "/?class=pluckable")
        assert status == 200
        assert b"<!DOCTYPE html>" in page
        assert "default-src 'none'" in headers["Content-Security-Policy"]
        assert json.loads(ask(server, "/gallery.json")[1]) == gallery.to_json()
        assert json.loads(ask(server, "/item/0.json")[1]) == gallery.items[0].details()
        for address, longest in (("/thumb/0.jpg", 80), ("/picture/1.jpg", 80)):
            status, body, headers = ask(server, address)
            assert (status, headers["Content-Type"]) == (200, "image/jpeg")
            assert max(cv2.imdecode(np.frombuffer(body, np.uint8), cv2.IMREAD_COLOR).shape) == longest
        status, body, headers = ask(server, "/thumb/0.jpg", method="HEAD")
        assert (status, body) == (200, b"")
        assert int(headers["Content-Length"]) > 0


@pytest.mark.parametrize(
    "address",
    [
        "/thumb/2.jpg",
        "/thumb/-1.jpg",
        "/thumb/99999999999.jpg",
        "/thumb/0.json",
        "/item/0.jpg",
        "/thumb/%30.jpg",
        "/annotations.json",
        "/../annotations.json",
        "/thumb/../../annotations.json",
        "/..%2f..%2fetc/passwd",
        "//etc/passwd",
        "/thumb/0.jpg/../../../etc/passwd",
    ],
)
def test_nothing_else_is_served(address: str, damaged: Path) -> None:
    with served(open_gallery(damaged)) as server:
        assert ask(server, address)[:2] == (404, b"not here\n")


def test_only_this_machine_is_answered(damaged: Path) -> None:
    with served(open_gallery(damaged)) as server:
        port = server.server_address[1]
        assert server.server_address[0] == "127.0.0.1"
        assert ask(server, "/", host=f"localhost:{port}")[0] == 200
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1:1", ""):
            status, body, _ = ask(server, "/gallery.json", host=host or " ")
            assert status == 403
            assert b"gone" not in body
        assert ask(server, "/", method="POST")[0] == 501


def test_a_port_that_is_taken_is_said(damaged: Path) -> None:
    gallery = open_gallery(damaged)
    with served(gallery) as server, pytest.raises(ConfigurationError, match="--port"):
        GalleryServer(gallery, server.server_address[1])


def test_the_page_needs_nothing_from_elsewhere() -> None:
    page = resources.files("punnet.data").joinpath("viewer_page.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://|src=\"//|@import|url\(", page)
    assert "innerHTML" not in page  # names of files are text, never markup
