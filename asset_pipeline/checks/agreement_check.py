"""Do an asset's two files say the same? What `asset.json` states of joints, mass and labels, against `model.xml`.

Tasks read one and simulate the other: where they differ, a task asks for what cannot be reached.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.geometry import Joint
from manipose_mj.assets.label import PoseLabel

PREFIX = "asset/"  # of names in `rest_scene`
KINDS = ("free", "ball", "slide", "hinge")  # in the order of mjtJoint
BASE = 1  # the body behind the world


@dataclass(frozen=True)
class AgreementLimits:
    """How far the two files may be apart.

    Attributes:
      joint: Of a joint's place [m], axis (difference of unit vectors) and range [m or rad].
      mass: As a share of the mass in `asset.json`.
      center: Of the centre of mass [m].
      label: From the object's bounding box to a label's origin, in diagonals of the box. A tool's origin
        may lie beside it, but not there.
    """

    joint: float = 1e-4
    mass: float = 0.01
    center: float = 0.001
    label: float = 3.0


LIMITS = AgreementLimits()


def joint_failures(asset: Asset, model: mujoco.MjModel) -> list[str]:
    """A line for each moving part of an articulated asset that the model does not have, or has elsewhere.

    Args:
      asset: As `asset.json` says.
      model: Of `rest_scene`.
    """
    data = _at_rest(model)
    names = [model.joint(i).name.removeprefix(PREFIX) for i in range(model.njnt)]
    stated = {part.name: part.joint for part in asset.parts}
    failures = [
        f"asset.json has a part {name!r}, but model.xml no joint of that name; its joints: {_list(names)}"
        for name in stated
        if name not in names
    ]
    for index, name in enumerate(names):
        if name in stated:
            failures += _joint_differences(model, data, index, name, stated[name])
        else:
            failures.append(
                f"model.xml has a joint {name!r}, but asset.json no part of that name; its parts: {_list(stated)}"
            )
    return failures


def body_failures(asset: Asset, model: mujoco.MjModel) -> list[str]:
    """A line for each way in which a rigid asset's mass, or any asset's labels, do not fit the model.

    Args:
      asset: As `asset.json` says.
      model: Of `rest_scene`.
    """
    data = _at_rest(model)
    solid = np.flatnonzero((model.geom_bodyid > 0) & (model.geom_contype > 0))
    failures = []
    if asset.kind == "rigid" and model.nbody > BASE:
        failures += mass_failures(asset, model)
    if len(solid):
        labels = {"label": asset.label}
        labels |= {f"handle of {p.name!r}": p.handle for p in asset.parts if p.handle is not None}
        failures += _far_labels(labels, _bounds(model, data, solid))
    return failures


def _joint_differences(
    model: mujoco.MjModel, data: mujoco.MjData, index: int, name: str, stated: Joint
) -> list[str]:
    kind = KINDS[model.jnt_type[index]]
    if kind != stated.kind:
        return [f"joint {name!r} is a {stated.kind} in asset.json, but a {kind} joint in model.xml"]
    failures = []
    turn = data.xmat[BASE].reshape(3, 3)
    axis = turn.T @ data.xaxis[index]
    if np.abs(axis - stated.axis).max() > LIMITS.joint:
        failures.append(_differs(name, "axis", stated.axis, axis))
    # Any point on the axis will do, and a slide moves alike wherever its axis is put.
    place = turn.T @ (data.xanchor[index] - data.xpos[BASE])
    apart = np.linalg.norm(np.cross(place - stated.origin, axis))
    if kind == "hinge" and apart > LIMITS.joint:
        failures.append(_differs(name, "place", stated.origin, place))
    limits = model.jnt_range[index]
    if not model.jnt_limited[index]:
        failures.append(f"joint {name!r} has a range in asset.json, but none in model.xml")
    elif np.abs(limits - stated.range).max() > LIMITS.joint:
        failures.append(_differs(name, "range", stated.range, limits))
    return failures


def mass_failures(asset: Asset, model: mujoco.MjModel) -> list[str]:
    """A line for each way in which a rigid asset's mass does not fit the model; arguments as above."""
    data = _at_rest(model)
    stated, masses = asset.mass_properties, model.body_mass[BASE:]
    failures = []
    if abs(masses.sum() - stated.mass) > LIMITS.mass * stated.mass:
        failures.append(
            f"weighs {stated.mass:.4g} kg in asset.json, but {masses.sum():.4g} kg in model.xml"
        )
    if masses.sum() > 0:
        middle = np.average(data.xipos[BASE:], axis=0, weights=masses) - data.xpos[BASE]
        middle = data.xmat[BASE].reshape(3, 3).T @ middle
        if np.linalg.norm(middle - stated.center_of_mass) > LIMITS.center:
            failures.append(
                f"its centre of mass is {_vector(stated.center_of_mass)} in asset.json, "
                f"but {_vector(middle)} in model.xml"
            )
    return failures


def _far_labels(labels: dict[str, PoseLabel], bounds: Float[np.ndarray, "2 3"]) -> list[str]:
    diagonal = np.linalg.norm(np.ptp(bounds, axis=0))
    failures = []
    for name, label in labels.items():
        apart = np.linalg.norm(label.origin - np.clip(label.origin, *bounds))
        if apart > LIMITS.label * diagonal:
            failures.append(
                f"origin of the {name} is {apart:.3g} m off the object, which is {diagonal:.3g} m across; "
                "expected it in or near the object"
            )
    return failures


def _bounds(
    model: mujoco.MjModel, data: mujoco.MjData, geoms: Int[np.ndarray, " g"]
) -> Float[np.ndarray, "2 3"]:
    """Lower and upper corner of the box around the geoms in the object frame [m]."""
    turn = data.xmat[BASE].reshape(3, 3)
    turns = turn.T @ data.geom_xmat[geoms].reshape(-1, 3, 3)
    middle, half = model.geom_aabb[geoms, :3], model.geom_aabb[geoms, 3:]
    middle = (
        np.einsum("gij,gj->gi", turns, middle) + (data.geom_xpos[geoms] - data.xpos[BASE]) @ turn
    )
    half = np.einsum("gij,gj->gi", np.abs(turns), half)
    return np.stack([(middle - half).min(axis=0), (middle + half).max(axis=0)])


def _at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    """All joints at zero."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return data


def _differs(name: str, what: str, stated: ArrayLike, found: ArrayLike) -> str:
    return (
        f"joint {name!r}: its {what} is {_vector(stated)} in asset.json, but {_vector(found)} "
        "in model.xml"
    )


def _vector(values: ArrayLike) -> str:
    return f"({', '.join(f'{v:.4g}' for v in np.round(np.asarray(values, float), 6) + 0.0)})"


def _list(names: Iterable[str]) -> str:
    return ", ".join(map(repr, names)) or "none"
