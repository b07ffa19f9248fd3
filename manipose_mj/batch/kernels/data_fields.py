"""Where MuJoCo keeps, in its `mjData`, what its Python arrays do not show the address of.

`mujoco.introspect` lists the fields of its structures in their order; `ctypes` lays them out as C does.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import mujoco
import numpy as np
from mujoco.introspect import ast_nodes
from mujoco.introspect.structs import STRUCTS

from manipose_mj.batch.kernels.cpu_loops import DataFields
from manipose_mj.errors import InputError
from manipose_mj.tasks.core.simulation_state import AWAKE_COUNTS

_PLAIN = {
    "int": ctypes.c_int,
    "mjtBool": ctypes.c_bool,
    "mjtNum": ctypes.c_double,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "uintptr_t": ctypes.c_void_p,
}


@cache
def data_fields() -> DataFields:
    """Of the MuJoCo that is installed.

    Raises:
      InputError: Its data are not laid out as its own list of fields says.
    """
    data, contact, warning = (_layout(name) for name in ("mjData", "mjContact", "mjWarningStat"))
    awake = np.array([getattr(data, name).offset for name in AWAKE_COUNTS])
    own = mujoco.MjData(mujoco.MjModel.from_xml_string("<mujoco/>"))
    for name in ("ncon", *AWAKE_COUNTS):
        before = getattr(own, name)
        setattr(own, name, 123_456_789)
        found = ctypes.c_int.from_address(own._address + getattr(data, name).offset).value
        setattr(own, name, before)
        if found != 123_456_789:
            raise InputError(
                f"mujoco {mujoco.__version__}: mjData.{name} is not where its own list of fields puts it: "
                "install mujoco again"
            )
    return DataFields(
        awake=awake,
        contact_count=data.ncon.offset,
        contacts=data.contact.offset,
        contact_bytes=ctypes.sizeof(contact),
        contact_geoms=contact.geom.offset,
        warnings=data.warning.offset + warning.number.offset,
        warning_bytes=ctypes.sizeof(warning),
    )


@cache
def _layout(name: str) -> type[ctypes.Structure]:
    """One of MuJoCo's structures."""
    fields = [(field.name, _type(field.type)) for field in STRUCTS[name].fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _type(listed: Any) -> Any:
    """Of one field, as `mujoco.introspect` lists it."""
    if isinstance(listed, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(listed, ast_nodes.ArrayType):
        kind = _type(listed.inner_type)
        for count in reversed(listed.extents):
            kind = kind * count
        return kind
    return _PLAIN[listed.name] if listed.name in _PLAIN else _layout(listed.name)
