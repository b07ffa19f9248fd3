"""A local server of scans that cuts, changes and refuses what is asked of it."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np

import tests.asset_pipeline.scan_files as files


class Site:
    """What the server has and how it misbehaves.

    Attributes:
      files: By path.
      cut: Bytes after which it hangs up, one number a request; None for all.
      tagged: Whether it says which version a file is.
      ranges: Whether it honours `Range`.
      stubborn: It sends a part of the new file where `If-Range` names the old one.
      errors: Status codes to answer with first.
      asked: Method, path and `Range` of what was asked for.
    """

    def __init__(self) -> None:
        self.files: dict[str, bytes] = {}
        self.cut: list[int | None] = []
        self.errors: list[int] = []
        self.tagged = self.ranges = True
        self.stubborn = self.silent = False
        self.asked: list[tuple[str, str | None]] = []

    def tag(self, path: str) -> str:
        return f'"{hashlib.md5(self.files[path]).hexdigest()}"'


class Handler(BaseHTTPRequestHandler):
    site: Site

    def do_GET(self) -> None:
        site, path = self.site, unquote(urlsplit(self.path).path)
        site.asked.append((self.path, self.headers.get("Range")))
        if site.errors:
            self.send_error(site.errors.pop(0))
            return
        if path not in site.files:
            self.send_error(404)
            return
        body, start = site.files[path], 0
        requested = self.headers.get("Range")
        same = self.headers.get("If-Range") in (None, site.tag(path)) or site.stubborn
        if requested and site.ranges and same:
            start = int(requested.removeprefix("bytes=").rstrip("-"))
            if start >= len(body):
                self.send_error(416)
                return
        self.send_response(206 if start else 200)
        if start:
            self.send_header("Content-Range", f"bytes {start}-{len(body) - 1}/{len(body)}")
        if not site.silent:
            self.send_header("Content-Length", str(len(body) - start))
        if site.tagged:
            self.send_header("ETag", site.tag(path))
        self.end_headers()
        cut = site.cut.pop(0) if site.cut else None
        self.wfile.write(body[start:] if cut is None else body[start : start + cut])
        self.close_connection = True

    def log_message(self, *_: object) -> None:
        pass


@contextmanager
def served() -> Iterator[Site]:
    """The server, running, with no files yet."""
    site = Site()
    handler = type("SiteHandler", (Handler,), {"site": site})
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as http:
        thread = threading.Thread(target=http.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        site.url = f"http://127.0.0.1:{http.server_port}"
        yield site
        http.shutdown()
        thread.join()


def archive(folder: Path, seed: int = 0, ending: str = "tgz", size: int = 400_000) -> bytes:
    """A scan's archive, of noise so that it stays large."""
    noise = np.random.default_rng(seed).bytes(size)
    path = folder / f"made-{seed}.{ending}"
    content = {"037_scissors/google_16k/textured.obj": files.obj(files.box((0.1, 0.1, 0.1)))}
    data = files.write_archive(path, content | {"noise": noise}).read_bytes()
    path.unlink()
    return data


def tree(folder: Path) -> set[str]:
    """Everything in a folder, relative to it."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}
