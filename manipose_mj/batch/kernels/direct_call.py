"""Calls of Python from JAX without copies: a handler of XLA's foreign function interface, written with `ctypes`.

`jax.pure_callback` makes arrays of JAX of what it is given, and copies what comes back; that takes as long as a world's
control step. This handler gives a function views of XLA's own buffers. The structures are those of
`xla/ffi/api/c_api.h`, which `jaxlib` brings along; fields are only ever added to their ends.
"""

from __future__ import annotations

import ctypes
import itertools
import logging
import math
from collections.abc import Callable, Sequence
from ctypes import POINTER, c_char_p, c_int, c_int64, c_size_t, c_void_p
from typing import Any
from weakref import WeakValueDictionary

import jax
import numpy as np
from jaxtyping import Array

from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

_TARGET = "manipose_mj_direct_call"
_METADATA, _UNKNOWN = 1, 2  # a kind of extension, and a code of errors
_KINDS = {
    1: np.bool_, 4: np.int32, 5: np.int64, 8: np.uint32, 9: np.uint64, 11: np.float32, 12: np.float64,
}  # fmt: skip
_HEAD = (("size", c_size_t), ("extension", c_void_p))  # that most structures begin with


class _Version(ctypes.Structure):
    _fields_ = (*_HEAD, ("major", c_int), ("minor", c_int))


class _Metadata(ctypes.Structure):
    _fields_ = (("size", c_size_t), ("version", _Version))


class _Extension(ctypes.Structure):
    _fields_ = (
        ("size", c_size_t),
        ("kind", c_int),
        ("next", c_void_p),
        ("metadata", POINTER(_Metadata)),
    )


class _Error(ctypes.Structure):
    _fields_ = (*_HEAD, ("message", c_char_p), ("code", c_int))


class _Api(ctypes.Structure):
    _fields_ = (
        *_HEAD,
        ("version", _Version),
        ("internal", c_void_p),
        ("create_error", ctypes.CFUNCTYPE(c_void_p, POINTER(_Error))),
    )


class _Buffer(ctypes.Structure):
    _fields_ = (
        *_HEAD,
        ("kind", c_int),
        ("data", c_void_p),
        ("rank", c_int64),
        ("shape", POINTER(c_int64)),
    )

    def view(self) -> np.ndarray:
        shape, kind = self.shape[: self.rank], np.dtype(_KINDS[self.kind])
        size = math.prod(shape) * kind.itemsize
        memory: Any = (ctypes.c_char * size).from_address(self.data)
        return np.frombuffer(memory, kind).reshape(shape)


class _Buffers(ctypes.Structure):
    _fields_ = (
        *_HEAD,
        ("count", c_int64),
        ("kinds", c_void_p),
        ("buffers", POINTER(POINTER(_Buffer))),
    )

    def views(self) -> list[np.ndarray]:
        return [self.buffers[i].contents.view() for i in range(self.count)]


class _Scalar(ctypes.Structure):
    _fields_ = (("kind", c_int), ("value", POINTER(c_int64)))


class _Attributes(ctypes.Structure):
    _fields_ = (
        *_HEAD,
        ("count", c_int64),
        ("kinds", c_void_p),
        ("names", c_void_p),
        ("values", POINTER(POINTER(_Scalar))),
    )


class _Frame(ctypes.Structure):
    _fields_ = (
        ("size", c_size_t),
        ("extension", POINTER(_Extension)),
        ("api", POINTER(_Api)),
        ("context", c_void_p),
        ("stage", c_int),
        ("arguments", _Buffers),
        ("results", _Buffers),
        ("attributes", _Attributes),
    )


class DirectCall:
    """A Python function as one of JAX; under `jax.jit` as well, not under `jax.vmap`.

    On other devices than the CPU it is called by `jax.pure_callback`. What was compiled does not keep it alive.
    """

    def __init__(
        self, function: Callable[..., None], results: Sequence[jax.ShapeDtypeStruct]
    ) -> None:
        """Prepares.

        Args:
          function: Given an array for each argument, to be read, then one for each result, to be written; all of them
            only for as long as it runs. What it raises becomes a `jax.errors.JaxRuntimeError` where somebody waits for a
            result. It may be called by any thread, after the call has returned.
          results: Their shapes and types.
        """
        self._function, self._results = function, tuple(results)
        self._number = np.int64(next(_numbers))
        # With an effect, a program that ends waits for it, and so can `jax.effects_barrier`.
        self._call = jax.ffi.ffi_call(_TARGET, self._results, has_side_effect=True)
        _calls[int(self._number)] = self

    def __call__(self, *arguments: Array) -> tuple[Array, ...]:
        """What the function writes for these arguments."""
        return jax.lax.platform_dependent(*arguments, cpu=self._direct, default=self._copied)

    def _direct(self, *arguments: Array) -> tuple[Array, ...]:
        return tuple(self._call(*arguments, number=self._number))

    def _copied(self, *arguments: Array) -> tuple[Array, ...]:
        def call(*given: Array) -> tuple[np.ndarray, ...]:
            results = tuple(np.zeros(each.shape, each.dtype) for each in self._results)
            self._function(*map(np.asarray, given), *results)
            return results

        return jax.pure_callback(call, self._results, *arguments)


_calls: WeakValueDictionary[int, DirectCall] = WeakValueDictionary()
_numbers = itertools.count()


@ctypes.CFUNCTYPE(c_void_p, POINTER(_Frame))
def _handle(pointer: Any) -> int | None:
    """Call the function whose number is the call's attribute; returns an error of XLA, or none."""
    frame = pointer.contents
    api = frame.api.contents
    if frame.extension and frame.extension.contents.kind == _METADATA:
        version = frame.extension.contents.metadata.contents.version
        version.major, version.minor = api.version.major, api.version.minor
        return None
    try:
        call = _calls.get(frame.attributes.values[0].contents.value[0])
        if call is None:
            raise InputError(
                "what a compiled function calls is gone; keep its worlds as long as it"
            )
        call._function(*frame.arguments.views(), *frame.results.views())
    except BaseException as error:  # nobody in XLA could catch it
        if not isinstance(error, InputError):
            log.exception("a function that JAX called failed")
        message = f"{type(error).__name__}: {error}".encode()
        told = _Error(ctypes.sizeof(_Error), None, message, _UNKNOWN)
        return api.create_error(ctypes.byref(told))
    return None


jax.ffi.register_ffi_target(
    _TARGET, jax.ffi.pycapsule(ctypes.cast(_handle, c_void_p).value), platform="cpu"
)
