"""A page on this machine that shows a gallery in the browser: pictures are drawn when they are looked at.

Nothing but numbers of photographs is taken from an address, so none leads out of the gallery; nothing is loaded from
elsewhere, and only requests to this machine by its own name are answered.
"""

from __future__ import annotations

import json
import re
import threading
from functools import lru_cache
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import Any

import cv2

from punnet.data.drawing import draw_annotated
from punnet.data.gallery import Gallery
from punnet.errors import ConfigurationError, PunnetError

__all__ = ["HOST", "GalleryServer"]

HOST = "127.0.0.1"
PAGE = "viewer_page.html"
SIDES = {"thumb": 360, "picture": 1600}
JPEG_QUALITY = 88
KEPT_PICTURES = 400
DRAWN_AT_A_TIME = 2
IMMUTABLE = "private, max-age=3600"
ADDRESS = re.compile(r"/(thumb|picture|item)/([0-9]{1,9})\.(jpg|json)")
# The page is one file; what it may do beside showing itself is written here.
POLICY = (
    "default-src 'none'; img-src 'self'; connect-src 'self'; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}


class GalleryServer(ThreadingHTTPServer):
    """Serves a gallery on 127.0.0.1 until it is shut down.

    Parameters
    ----------
    gallery
        What to show.
    port
        0 takes any free one; see :attr:`url`.

    Raises
    ------
    ConfigurationError
        If the port is taken or not allowed.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, gallery: Gallery, port: int = 0) -> None:
        self.gallery = gallery
        self.page = resources.files("punnet.data").joinpath(PAGE).read_bytes()
        self.listing = _encode(gallery.to_json())
        self._drawing = threading.Semaphore(DRAWN_AT_A_TIME)
        self.picture = lru_cache(KEPT_PICTURES)(self._picture)
        try:
            super().__init__((HOST, port), _Handler)
        except (OSError, OverflowError) as error:
            raise ConfigurationError(f"port {port}: can't be used ({error}); give another --port") from error

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://{HOST}:{self.server_address[1]}/"

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of a browser that hangs up; the rest is for the log of the caller."""
        del request, client_address

    def _picture(self, kind: str, number: int) -> bytes:
        """One photograph as JPEG."""
        with self._drawing:
            image = self.gallery.items[number].annotated()
            picture = draw_annotated(image, SIDES[kind])
        _, encoded = cv2.imencode(".jpg", picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
        return encoded.tobytes()


class _Handler(BaseHTTPRequestHandler):
    server: GalleryServer
    server_version = "punnet"
    sys_version = ""

    def do_GET(self) -> None:
        if not self._is_asked_by_name():
            self._answer(HTTPStatus.FORBIDDEN, b"only for this machine\n", "text/plain")
            return
        address = self.path.partition("?")[0]
        if address == "/":
            self._answer(HTTPStatus.OK, self.server.page, "text/html; charset=utf-8")
        elif address == "/gallery.json":
            self._answer(HTTPStatus.OK, self.server.listing, "application/json")
        else:
            self._item(address)

    do_HEAD = do_GET  # noqa: N815  (the name that http.server looks for)

    def _is_asked_by_name(self) -> bool:
        """A page of somebody else's that resolves its name to 127.0.0.1 must not read this one."""
        port = self.server.server_address[1]
        return self.headers.get("Host") in (f"{HOST}:{port}", f"localhost:{port}")

    def _item(self, address: str) -> None:
        match = ADDRESS.fullmatch(address)
        if match is None or int(match[2]) >= len(self.server.gallery.items):
            self._answer(HTTPStatus.NOT_FOUND, b"not here\n", "text/plain")
            return
        kind, number = match[1], int(match[2])
        if (kind == "item") != (match[3] == "json"):
            self._answer(HTTPStatus.NOT_FOUND, b"not here\n", "text/plain")
        elif kind == "item":
            details = self.server.gallery.items[number].details()
            self._answer(HTTPStatus.OK, _encode(details), "application/json")
        else:
            try:
                picture = self.server.picture(kind, number)
            except PunnetError as error:
                self._answer(HTTPStatus.UNPROCESSABLE_ENTITY, f"{error}\n".encode(), "text/plain")
            else:
                self._answer(HTTPStatus.OK, picture, "image/jpeg", IMMUTABLE)

    def _answer(self, status: HTTPStatus, body: bytes, kind: str, caching: str = "no-store") -> None:
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind, "Cache-Control": caching}.items():
            self.send_header(name, value)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        del format, args


def _encode(data: Any) -> bytes:
    return json.dumps(data, ensure_ascii=False).encode("utf-8", "replace")
