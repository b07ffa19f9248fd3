"""Messages of bytes over a pipe: their length, then they."""

from __future__ import annotations

import os
import struct

_LENGTH = struct.Struct("<Q")


def write_message(pipe: int, message: bytes) -> None:
    """Write one message to a file descriptor.

    Raises:
      BrokenPipeError: Nobody reads any more.
    """
    data = memoryview(_LENGTH.pack(len(message)) + message)
    while data:
        data = data[os.write(pipe, data) :]


def read_message(pipe: int) -> bytes | None:
    """Read one message from a file descriptor; None if the writer closed it, in whatever place."""
    head = _exactly(pipe, _LENGTH.size)
    return None if head is None else _exactly(pipe, _LENGTH.unpack(head)[0])


def _exactly(pipe: int, count: int) -> bytes | None:
    data = bytearray()
    while len(data) < count:
        chunk = os.read(pipe, min(count - len(data), 1 << 20))
        if not chunk:
            return None
        data += chunk
    return bytes(data)
