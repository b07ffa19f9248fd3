"""Messages as openpi frames them: msgpack, with NumPy arrays and scalars as tagged maps.

An array is `{b"__ndarray__": True, b"data": bytes, b"dtype": str, b"shape": (...)}`, a scalar `{b"__npgeneric__": True,
b"data": value, b"dtype": str}` (`openpi_client.msgpack_numpy`, https://github.com/Physical-Intelligence/openpi).
"""

from __future__ import annotations

from typing import Any

import msgpack
import numpy as np

_ARRAY, _SCALAR = b"__ndarray__", b"__npgeneric__"
_UNPACKABLE = "OVc"  # objects, records, complex numbers


def pack(message: Any) -> bytes:
    """The bytes of a message.

    Raises:
      TypeError: It holds something that msgpack does not know, or an array of objects.
    """
    packed = msgpack.packb(message, default=_tagged)
    assert isinstance(packed, bytes)
    return packed


def unpack(data: bytes) -> Any:
    """The message that bytes hold; its arrays may be written to.

    Raises:
      ValueError: They hold none.
    """
    try:
        return msgpack.unpackb(data, object_hook=_untagged, strict_map_key=False)
    except (msgpack.UnpackException, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"no msgpack message ({error or type(error).__name__})") from None


def _tagged(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        if value.dtype.kind in _UNPACKABLE:
            raise TypeError(f"arrays of {value.dtype} cannot be sent")
        if isinstance(value, np.generic):
            return {_SCALAR: True, b"data": value.item(), b"dtype": value.dtype.str}
        return {
            _ARRAY: True,
            b"data": value.tobytes(),
            b"dtype": value.dtype.str,
            b"shape": value.shape,
        }
    raise TypeError(f"a {type(value).__name__} cannot be sent")


def _untagged(value: dict[Any, Any]) -> Any:
    if _ARRAY in value:
        array = np.frombuffer(value[b"data"], np.dtype(value[b"dtype"]))
        return array.reshape(value[b"shape"]).copy()
    if _SCALAR in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value
