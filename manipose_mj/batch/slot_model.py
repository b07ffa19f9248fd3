"""One model for scenes that differ in objects and furniture: shapes become slots that every world fills for itself.

MuJoCo Warp takes which mesh a geom is, its size and its pose from each world, but not its type: a body has as
many slots of each type as any scene needs. Slots that a world leaves empty touch nothing. Visual shapes of such
bodies are left out.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

from manipose_mj.batch.slot_bodies import (
    NONE,
    Place,
    ScenePlaces,
    add_missing,
    common_tree,
    scene_places,
)
from manipose_mj.batch.starts import StartPool
from manipose_mj.errors import InputError

_MESH = int(mujoco.mjtGeom.mjGEOM_MESH)
# Of a geom, what MuJoCo Warp has once for all worlds; the shapes in a slot have to agree on it.
_SHARED = ("geom_contype", "geom_conaffinity", "geom_condim", "geom_priority", "geom_group")
_ALIKE = (*_SHARED, "geom_solmix", "geom_solref", "geom_solimp", "geom_gap")
_EMPTY_MARGIN = -1e9  # [m]: nothing is as near
FIELDS = (
    "geom_dataid",
    "geom_size",
    "geom_aabb",
    "geom_rbound",
    "geom_pos",
    "geom_quat",
    "geom_margin",
    "geom_rgba",
)


@dataclass(frozen=True)
class SlotModel:
    """A model with slots, and how each scene fills them.

    Attributes:
      model: With the bodies, joints, sites, cameras and actuators of every scene.
      geoms: For each scene, which of its geoms is in each of the model's; -1: none.
      fields: For each scene, the `FIELDS` of the model's geoms.
      places: For each scene, which of its bodies and joints are the model's.
    """

    model: mujoco.MjModel
    geoms: tuple[Int[np.ndarray, " geoms"], ...]
    fields: tuple[dict[str, np.ndarray], ...]
    places: tuple[ScenePlaces, ...]


def slot_model(pool: StartPool, *, visual: bool = False) -> SlotModel:
    """The model for all scenes of a pool.

    Args:
      pool: Of starts.
      visual: Whether to keep visual shapes.

    Raises:
      InputError: The scenes differ in more than bodies, their shapes and joints.
    """
    scenes = pool.scenes
    if len(scenes) == 1:
        only = scenes[0]
        return SlotModel(only, (np.arange(only.ngeom),), ({},), (ScenePlaces.same(only),))
    tree = common_tree(scenes)
    spec = mujoco.MjSpec.from_string(pool.xml, assets=dict(pool.xml_assets))
    names = add_missing(spec, scenes, tree)
    for name, place in zip(names, tree, strict=True):
        if NONE in place.bodies:
            spec.body(name).gravcomp = 1.0  # what no world has does not fall in it
    changing = [number for number, place in enumerate(tree) if _differs(scenes, place)]
    slots = {
        number: _add_slots(spec, scenes, tree[number], names[number], number, visual=visual)
        for number in changing
    }
    model = spec.compile()
    _copy_options(scenes[0].opt, model.opt)
    changed = [model.body(names[number]).id for number in changing]
    geoms, fields, places = [], [], []
    for number, scene in enumerate(scenes):
        chosen = np.full(model.ngeom, NONE)
        for index, place in enumerate(tree):
            if index in slots:
                for name, sources in slots[index].items():
                    chosen[model.geom(name).id] = sources[number]
            else:
                body = model.body(names[index]).id
                chosen[_geoms(model, body)] = _geoms(scene, place.bodies[number])
        geoms.append(chosen)
        fields.append(_filled(model, scene, number, chosen, changed))
        places.append(scene_places(model, scene, number, tree, names))
    return SlotModel(model, tuple(geoms), tuple(fields), tuple(places))


def _copy_options(source: mujoco.MjOption, target: mujoco.MjOption) -> None:
    """The options that the scenes have now, which may be others than their XML says."""
    for name in dir(source):
        value = getattr(source, name)
        if isinstance(value, np.ndarray):
            getattr(target, name)[:] = value
        elif isinstance(value, int | float) and not name.startswith("_"):
            setattr(target, name, value)


def _geoms(model: mujoco.MjModel, body: int) -> Int[np.ndarray, " geoms"]:
    return model.body_geomadr[body] + np.arange(model.body_geomnum[body])


def _solid(model: mujoco.MjModel, body: int) -> Int[np.ndarray, " geoms"]:
    """The geoms of a body that can touch something."""
    geoms = _geoms(model, body)
    return geoms[(model.geom_contype[geoms] | model.geom_conaffinity[geoms]) != 0]


def _differs(scenes: tuple[mujoco.MjModel, ...], place: Place) -> bool:
    """Whether the geoms in a place are not the same in all scenes."""
    if NONE in place.bodies:
        return True
    first, own = scenes[0], _geoms(scenes[0], place.bodies[0])
    for scene, body in zip(scenes[1:], place.bodies[1:], strict=True):
        other = _geoms(scene, body)
        if len(own) != len(other) or any(
            not np.array_equal(getattr(first, name)[own], getattr(scene, name)[other])
            for name in ("geom_type", "geom_size", "geom_pos", "geom_quat", *_ALIKE)
        ):
            return True
    return False


def _add_slots(
    spec: mujoco.MjSpec,
    scenes: tuple[mujoco.MjModel, ...],
    place: Place,
    body: str,
    index: int,
    *,
    visual: bool,
) -> dict[str, list[int]]:
    """Replace a body's geoms by slots.

    Returns:
      By the slots' names, the geom of each scene in it; -1: none.
    """
    element = spec.body(body)
    for geom in list(element.geoms):
        spec.delete(geom)
    by_type: dict[tuple[int, bool], list[list[int]]] = {}
    for number, (scene, own) in enumerate(zip(scenes, place.bodies, strict=True)):
        if own == NONE:
            continue
        counts: Counter[tuple[int, bool]] = Counter()
        solid = _solid(scene, own)
        for geom in (_geoms(scene, own) if visual else solid).tolist():
            kind = int(scene.geom_type[geom]), geom in solid
            rows = by_type.setdefault(kind, [])
            order = counts[kind]
            counts[kind] += 1
            if order == len(rows):
                rows.append([NONE] * len(scenes))
            rows[order][number] = geom
    slots: dict[str, list[int]] = {}
    for (kind, solid), rows in by_type.items():
        for order, sources in enumerate(rows):
            name = f"slot_{index}_{kind}_{'solid' if solid else 'visual'}_{order}"
            _add_slot(spec, element, name, kind, sources, scenes)
            slots[name] = sources
    return slots


def _add_slot(
    spec: mujoco.MjSpec,
    body: mujoco.MjsBody,
    name: str,
    kind: int,
    sources: list[int],
    scenes: tuple[mujoco.MjModel, ...],
) -> None:
    """One geom with the shapes of all scenes that have one there, and their meshes."""
    number = next(i for i, geom in enumerate(sources) if geom >= 0)
    scene, geom = scenes[number], sources[number]
    for other, source in zip(scenes, sources, strict=True):
        for field in _ALIKE:
            if source >= 0 and not np.array_equal(
                getattr(other, field)[source], getattr(scene, field)[geom]
            ):
                raise InputError(f"engine 'warp': objects differ in {field}; take engine 'c'")
        if source >= 0 and kind == _MESH:
            mesh = int(other.geom_dataid[source])
            first, count = int(other.mesh_vertadr[mesh]), int(other.mesh_vertnum[mesh])
            vertices = other.mesh_vert[first : first + count]
            added_mesh = spec.add_mesh(
                name=_mesh_name(scenes.index(other), source), uservert=vertices.ravel().tolist()
            )
            if not other.geom_contype[source]:
                # What is seen need be neither convex nor closed.
                face, faces = int(other.mesh_faceadr[mesh]), int(other.mesh_facenum[mesh])
                added_mesh.userface = other.mesh_face[face : face + faces].ravel().tolist()
                added_mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    shared = {field.removeprefix("geom_"): int(getattr(scene, field)[geom]) for field in _SHARED}
    added = body.add_geom(name=name, type=mujoco.mjtGeom(kind), **shared)
    added.size = scene.geom_size[geom]
    added.solref, added.solimp = scene.geom_solref[geom], scene.geom_solimp[geom]
    added.solmix = float(scene.geom_solmix[geom])
    added.friction = scene.geom_friction[geom]
    added.mass = 0.0
    if kind == _MESH:
        added.meshname = _mesh_name(number, geom)


def _mesh_name(scene: int, geom: int) -> str:
    return f"slot_mesh_{scene}_{geom}"


def _filled(
    model: mujoco.MjModel,
    scene: mujoco.MjModel,
    number: int,
    chosen: Int[np.ndarray, " geoms"],
    changing: list[int],
) -> dict[str, np.ndarray]:
    """The fields of the model's geoms in this scene."""
    fields = {name: np.array(getattr(model, name), copy=True) for name in FIELDS}
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, changing)):
        source = int(chosen[geom])
        if source < 0:
            if model.geom_type[geom] == _MESH and model.geom_contype[geom]:
                fields["geom_dataid"][geom] = -1
            fields["geom_margin"][geom] = _EMPTY_MARGIN
            fields["geom_rgba"][geom, 3] = 0.0
            continue
        for name in FIELDS:
            if name != "geom_dataid":
                fields[name][geom] = getattr(scene, name)[source]
        if scene.geom_matid[source] >= 0:
            fields["geom_rgba"][geom] = scene.mat_rgba[scene.geom_matid[source]]
        if model.geom_type[geom] == _MESH:
            mesh = model.mesh(_mesh_name(number, source)).id
            fields["geom_dataid"][geom] = mesh
            position, quaternion = _moved(
                scene.geom_pos[source], scene.geom_quat[source], model, mesh
            )
            fields["geom_pos"][geom], fields["geom_quat"][geom] = position, quaternion
            box, size, radius = _bounds(model, mesh)
            fields["geom_aabb"][geom] = box
            fields["geom_size"][geom] = size
            fields["geom_rbound"][geom] = radius
    return fields


def _moved(
    position: Float[np.ndarray, "3"],
    quaternion: Float[np.ndarray, "4"],
    model: mujoco.MjModel,
    mesh: int,
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "4"]]:
    """The geom's pose for the mesh as it was compiled again: MuJoCo centres and turns vertices."""
    offset, turned = np.empty(3), np.empty(4)
    mujoco.mju_rotVecQuat(offset, model.mesh_pos[mesh], quaternion)
    mujoco.mju_mulQuat(turned, quaternion, model.mesh_quat[mesh])
    return position + offset, turned


def _bounds(
    model: mujoco.MjModel, mesh: int
) -> tuple[Float[np.ndarray, "6"], Float[np.ndarray, "3"], float]:
    """A mesh's bounding box (middle, half lengths), half lengths about its frame, and radius [m]."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[first : first + count].astype(float)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    size = np.maximum(np.abs(low), np.abs(high))
    return np.concatenate([(low + high) / 2, (high - low) / 2]), size, float(np.linalg.norm(size))
