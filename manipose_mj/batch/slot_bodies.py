"""The bodies of several scenes as one tree: which body of each scene stands in which of its places.

Children of a place that have joints of the same types share places in their order, whatever they are called: the
drawers of one cabinet and those of another. So do bodies without joints, but for those that have one name in all
scenes, such as the table.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Int

from manipose_mj.errors import InputError

NONE = -1
_COUNTS = ("nu", "nsite", "ncam", "neq", "ntendon", "nexclude", "npair")
# Of a joint, what MuJoCo Warp has once for all worlds, and what is compared instead of copied.
_SHARED = ("jnt_limited", "jnt_actfrclimited")
_MASS, _INERTIA = 0.1, 1e-3  # of a body in no scene [kg, kg m^2]


@dataclass(frozen=True)
class Place:
    """A body of the common tree.

    Attributes: parent: which place; 0 for the world's own; bodies: of each scene; -1: none.
    """

    parent: int
    bodies: tuple[int, ...]


def common_tree(scenes: Sequence[mujoco.MjModel]) -> list[Place]:
    """The places of all bodies, parents first; the first is the world.

    Raises:
      InputError: The scenes differ in more than bodies, their shapes and joints.
    """
    for scene in scenes[1:]:
        different = [n for n in _COUNTS if getattr(scene, n) != getattr(scenes[0], n)]
        if different:
            raise InputError(_different(", ".join(different)))
    places: list[Place] = []
    _merge(scenes, tuple(0 for _ in scenes), 0, places)
    numbers = [_inverse([place.bodies[i] for place in places]) for i in range(len(scenes))]
    for name in ("site_bodyid", "cam_bodyid"):
        for scene, number in zip(scenes, numbers, strict=True):
            if not np.array_equal(
                number[getattr(scene, name)], numbers[0][getattr(scenes[0], name)]
            ):
                raise InputError(_different(name))
    return places


def add_missing(
    spec: mujoco.MjSpec, scenes: Sequence[mujoco.MjModel], places: Sequence[Place]
) -> list[str]:
    """Add bodies to the first scene's description, for places that are empty in it.

    Returns:
      Names of the bodies of all places.

    Raises:
      InputError: Joints in one place differ in what all worlds have to have in common.
    """
    names: list[str] = []
    for number, place in enumerate(places):
        _require_joints_alike(scenes, place)
        if place.bodies[0] != NONE:
            names.append(scenes[0].body(place.bodies[0]).name)
            continue
        names.append(f"place_{number}")
        source = next(i for i, body in enumerate(place.bodies) if body != NONE)
        _add_body(spec.body(names[place.parent]), names[-1], scenes[source], place.bodies[source])
    return names


@dataclass(frozen=True)
class ScenePlaces:
    """What of a scene stands where in the common model.

    Attributes: bodies, joints, dofs, angles: of the scene, for each of the common model's; -1: none; angles are
    entries of `qpos`.
    """

    bodies: Int[np.ndarray, " bodies"]
    joints: Int[np.ndarray, " joints"]
    dofs: Int[np.ndarray, " dofs"]
    angles: Int[np.ndarray, " nq"]

    def placed(self, name: str, ids: Int[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
        """The common model's ids of a scene's `bodies`, `dofs` or `angles`."""
        return _inverse(getattr(self, name))[ids]

    @classmethod
    def same(cls, model: mujoco.MjModel) -> ScenePlaces:
        """Of a scene that is the common model."""
        return cls(*(np.arange(n) for n in (model.nbody, model.njnt, model.nv, model.nq)))


def scene_places(
    model: mujoco.MjModel,
    scene: mujoco.MjModel,
    number: int,
    places: Sequence[Place],
    names: Sequence[str],
) -> ScenePlaces:
    """How the scene of this number fills the common model, which was compiled."""
    bodies = np.full(model.nbody, NONE)
    joints = np.full(model.njnt, NONE)
    dofs, angles = np.full(model.nv, NONE), np.full(model.nq, NONE)
    for place, name in zip(places, names, strict=True):
        source = place.bodies[number]
        if source == NONE:
            continue
        target = model.body(name).id
        bodies[target] = source
        for own, other in zip(_joints(model, target), _joints(scene, source), strict=True):
            joints[own] = other
        for found, count, first in (
            (dofs, _dofs, lambda m, b: m.body_dofadr[b]),
            (angles, _angles, lambda m, b: m.jnt_qposadr[m.body_jntadr[b]]),
        ):
            size = count(scene, source)
            if size:
                a, b = first(model, target), first(scene, source)
                found[a : a + size] = b + np.arange(size)
    return ScenePlaces(bodies, joints, dofs, angles)


def _merge(
    scenes: Sequence[mujoco.MjModel], bodies: tuple[int, ...], parent: int, places: list[Place]
) -> None:
    """Append the place of some bodies, then those below it."""
    number = len(places)
    places.append(Place(parent, bodies))
    groups: dict[Hashable, list[list[int]]] = {}
    named = _names_of_all(scenes, bodies)
    for index, (scene, body) in enumerate(zip(scenes, bodies, strict=True)):
        counts: Counter[Hashable] = Counter()
        for child in _children(scene, body):
            types = tuple(scene.jnt_type[_joints(scene, child)].tolist())
            name = scene.body(child).name
            kind = name if not types and name in named else types
            rows = groups.setdefault(kind, [])
            if counts[kind] == len(rows):
                rows.append([NONE] * len(scenes))
            rows[counts[kind]][index] = child
            counts[kind] += 1
    for rows in groups.values():
        for row in rows:
            _merge(scenes, tuple(row), number, places)


def _children(model: mujoco.MjModel, body: int) -> list[int]:
    if body == NONE:
        return []
    return [int(i) for i in np.flatnonzero(model.body_parentid == body) if i != 0]


def _names_of_all(scenes: Sequence[mujoco.MjModel], bodies: tuple[int, ...]) -> set[str]:
    """The names that children of these bodies have in every scene that has the body."""
    names = [
        {scene.body(child).name for child in _children(scene, body)}
        for scene, body in zip(scenes, bodies, strict=True)
        if body != NONE
    ]
    return set.intersection(*names)


def _joints(model: mujoco.MjModel, body: int) -> Int[np.ndarray, "n"]:
    return model.body_jntadr[body] + np.arange(model.body_jntnum[body])


def _dofs(model: mujoco.MjModel, body: int) -> int:
    return int(model.body_dofnum[body])


def _angles(model: mujoco.MjModel, body: int) -> int:
    free = model.jnt_type[_joints(model, body)] == mujoco.mjtJoint.mjJNT_FREE
    return _dofs(model, body) + int(free.sum())


def _require_joints_alike(scenes: Sequence[mujoco.MjModel], place: Place) -> None:
    found = set()
    for scene, body in zip(scenes, place.bodies, strict=True):
        if body != NONE:
            joints = _joints(scene, body)
            hinged = scene.jnt_type[joints] != mujoco.mjtJoint.mjJNT_FREE
            rest = scene.qpos0[scene.jnt_qposadr[joints[hinged]]]
            found.add((*(tuple(getattr(scene, n)[joints]) for n in _SHARED), tuple(rest)))
    if len(found) > 1:
        raise InputError(_different("limits or references of joints"))


def _add_body(
    parent: mujoco.MjsBody, name: str, scene: mujoco.MjModel, source: int
) -> mujoco.MjsBody:
    body = parent.add_body(name=name)
    if scene.body_dofnum[source]:
        body.explicitinertial = True
        body.mass, body.inertia = _MASS, [_INERTIA] * 3
    for joint in _joints(scene, source):
        dof = int(scene.jnt_dofadr[joint])
        body.add_joint(
            name=f"{name}_{joint}",
            type=mujoco.mjtJoint(int(scene.jnt_type[joint])),
            axis=scene.jnt_axis[joint],
            limited=int(scene.jnt_limited[joint]),
            range=scene.jnt_range[joint],
            damping=[float(scene.dof_damping[dof]), 0.0, 0.0],
            frictionloss=float(scene.dof_frictionloss[dof]),
            armature=float(scene.dof_armature[dof]),
        )
    return body


def _inverse(index: Sequence[int] | Int[np.ndarray, "n"]) -> Int[np.ndarray, "m"]:
    """Where each entry is; -1: nowhere."""
    index = np.asarray(index)
    inverse = np.full(int(index.max(initial=NONE)) + 1, NONE)
    present = np.flatnonzero(index != NONE)
    inverse[index[present]] = present
    return inverse


def _different(what: str) -> str:
    return (
        f"engine 'warp' takes scenes that differ in objects and furniture alone; these differ in {what}: name "
        "objects in `objects` that make them alike, or take engine 'c'"
    )
