"""A websocket server of a method, as openpi writes them, in a thread of the test."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Thread
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

from manipose_mj.wire.framing import pack, unpack


@contextmanager
def answering(
    answer: Callable[[dict[str, Any]], Any], *, metadata: Any = None, after: int | None = None
) -> Iterator[str]:
    """The address of a server that answers every question; it hangs up instead of answer number `after`."""

    def handle(socket: Any) -> None:
        first = {} if metadata is None else metadata
        socket.send(first if isinstance(first, str | bytes) else pack(first))
        count = 0
        try:
            while True:
                question = unpack(socket.recv())
                if count == after:
                    return
                count += 1
                try:
                    said = answer(question)
                except Exception:
                    socket.send(traceback.format_exc())
                    return
                socket.send(said if isinstance(said, str | bytes) else pack(said))
        except ConnectionClosed:
            return

    with serve(handle, "127.0.0.1", 0, compression=None, max_size=None) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()
            thread.join()
