"""Whether what an asset folder has for a simulator is a model of its asset."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import mujoco

from manipose_mj.assets.asset import MODEL_FILE, Asset
from manipose_mj.errors import InputError


def check_model(asset: Asset) -> None:
    """Compile an asset's MJCF alone, once a process.

    Raises:
      InputError: MuJoCo cannot compile it, no body of it has a geom, or a moving part has no body or joint there.
    """
    place = f"{asset.place}/{MODEL_FILE}"
    try:
        bodies, joints = compiled_names(asset.model_path)
    except (ValueError, mujoco.FatalError) as error:  # MuJoCo's compiler
        line = " ".join(str(error).split())
        raise InputError(f"{place}: does not compile: {line}") from None
    if not bodies:
        raise InputError(f"{place}: has no body with a geom")
    for part in asset.parts:
        for kind, names in (("body", bodies), ("joint", joints)):
            if part.name not in names:
                raise InputError(f"{place}: has no {kind} {part.name!r}, a part of asset.json")


def refuse_frames(spec: mujoco.MjSpec, place: str) -> None:
    """Complain of what scenes cannot take from a model, as dm_control does not know it.

    Args:
      spec: The model as it is written.
      place: Of its file, for the message.

    Raises:
      InputError: It has a `<frame>`.
    """
    if spec.frames:
        raise InputError(f"{place}: scenes take no <frame>; write its pose into what it holds")


@lru_cache(maxsize=1024)
def compiled_names(path: Path) -> tuple[frozenset[str], frozenset[str]]:
    """Names of the bodies that have geoms, and of the joints."""
    model = mujoco.MjModel.from_xml_path(str(path))
    bodies = {model.body(i).name for i in range(1, model.nbody) if model.body_geomnum[i]}
    return frozenset(bodies), frozenset(model.joint(i).name for i in range(model.njnt))
