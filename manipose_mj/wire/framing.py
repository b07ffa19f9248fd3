"""Messages as openpi frames them: msgpack, with NumPy arrays as dictionaries of bytes.

An array is `{b"__ndarray__": True, b"data": bytes, b"dtype": "<f4", b"shape": (3,)}`, a NumPy number
`{b"__npgeneric__": True, b"data": 1.0, b"dtype": "<f4"}`: as in `openpi_client.msgpack_numpy`, so that its servers
and clients understand ours. Nothing is pickled.
"""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np

_ARRAY, _NUMBER = b"__ndarray__", b"__npgeneric__"
_PLAIN = "biufSU"  # kinds of types whose bytes mean the same everywhere


def pack(message: Any) -> bytes:
    """A message as bytes.

    Args:
      message: Dictionaries, lists, strings, bytes, numbers, None, NumPy arrays and NumPy numbers.

    Raises:
      TypeError: Something else is in it.
    """
    return msgpack.packb(message, default=_encoded)


def unpack(content: bytes) -> Any:
    """The message that `pack` or `openpi_client.msgpack_numpy` made bytes of; its arrays can be written to.

    Raises:
      ValueError: The bytes are no such message.
    """
    try:
        return msgpack.unpackb(content, object_hook=_decoded, strict_map_key=False)
    except (ValueError, KeyError, TypeError, msgpack.UnpackException) as error:
        raise ValueError(f"no msgpack message ({type(error).__name__}: {error})") from None


def _encoded(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind not in _PLAIN:
        raise TypeError(f"an array of type {value.dtype} cannot be sent")
    if isinstance(value, np.ndarray):
        own = {b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
        return {_ARRAY: True, **own}
    if isinstance(value, np.generic):
        return {_NUMBER: True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"a {type(value).__name__} cannot be sent")


def _decoded(value: dict[Any, Any]) -> Any:
    if _ARRAY in value:
        flat = np.frombuffer(value[b"data"], np.dtype(value[b"dtype"]))
        return flat.reshape(value[b"shape"]).copy()
    if _NUMBER in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value
