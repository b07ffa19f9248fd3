"""What is seen of a built asset, and what touches, read back from its `model.xml`: the inverse of what `emit` writes.

MuJoCo compiles the model, so that classes, included files, frames and folders of meshes count as they do in a
simulation. Meshes that are files as they stand come from those: their vertices are more exact than MuJoCo's.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import cast

import mujoco
import numpy as np
import trimesh
from jaxtyping import Float
from trimesh.visual import TextureVisuals

from manipose_mj.assets.asset import MODEL_FILE
from manipose_mj.assets.geometry import Shape
from manipose_mj.assets.physics import COLLISION_GROUP
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, quaternion_to_rotation

# How many of MuJoCo's three sizes each primitive has.
_SIZES = {"box": 3, "cylinder": 2, "capsule": 2, "sphere": 1, "ellipsoid": 3}
# MuJoCo's colour of a geom that states none: its material's counts.
_UNSTATED = (0.5, 0.5, 0.5, 1.0)
_ROUNDING = 1e-9  # of the pose of a mesh that is where its body is [m]


def visible_shapes(folder: Path) -> dict[str, tuple[Shape, ...]]:
    """The visual shapes of every body by its name, in the object frame with all joints at zero.

    Seen is what is of a group that cameras see, and not wholly transparent. The object frame is that of the first
    body.

    Raises:
      InputError: The model or a mesh it names cannot be read, or nothing is to be seen.
    """
    model = _Model.read(folder)
    shapes = model.shapes([geom for geom in model.geoms if model.is_seen(geom)])
    if not any(shapes.values()):
        raise InputError(
            f"{model.path}: has nothing to be seen: no geom is of a group below {COLLISION_GROUP}"
        )
    return shapes


def collision_shapes(folder: Path) -> dict[str, tuple[Shape, ...]]:
    """The collision shapes of every body by its name, in the object frame with all joints at zero.

    Raises:
      InputError: The model or a mesh it names cannot be read.
    """
    model = _Model.read(folder)
    return model.shapes([geom for geom in model.geoms if model.compiled.geom_contype[geom]])


def surface(shapes: dict[str, tuple[Shape, ...]]) -> trimesh.Trimesh:
    """All of an object as one mesh without colours or textures, in the object frame."""
    meshes = [shape.surface() for own in shapes.values() for shape in own]
    bare = [trimesh.Trimesh(m.vertices, m.faces, process=False) for m in meshes]
    return cast(trimesh.Trimesh, trimesh.util.concatenate(bare))


@dataclass(frozen=True)
class _Model:
    """An asset's model, and where its bodies are with all joints at zero."""

    path: Path
    spec: mujoco.MjSpec
    compiled: mujoco.MjModel
    data: mujoco.MjData

    @classmethod
    def read(cls, folder: Path) -> _Model:
        path = folder / MODEL_FILE
        try:
            spec = mujoco.MjSpec.from_file(str(path))
            compiled = spec.compile()
        except (ValueError, mujoco.FatalError) as error:  # MuJoCo's compiler
            line = " ".join(str(error).split())
            raise InputError(f"{path}: does not compile: {line}") from None
        data = mujoco.MjData(compiled)
        mujoco.mj_kinematics(compiled, data)
        return cls(path, spec, compiled, data)

    @property
    def geoms(self) -> list[int]:
        """Those of bodies, not of the world."""
        return np.flatnonzero(self.compiled.geom_bodyid > 0).tolist()

    def is_seen(self, geom: int) -> bool:
        group = self.compiled.geom_group[geom]
        return bool(group < COLLISION_GROUP and self._colour(geom, None)[3] > 0)

    def shapes(self, geoms: list[int]) -> dict[str, tuple[Shape, ...]]:
        """Of every body, also of those without."""
        owners = self.compiled.geom_bodyid
        return {
            self.compiled.body(body).name: tuple(
                self._shape(geom) for geom in geoms if owners[geom] == body
            )
            for body in range(1, self.compiled.nbody)
        }

    def _shape(self, geom: int) -> Shape:
        model = self.compiled
        pose = self._body_pose(model.geom_bodyid[geom]) @ _pose(
            model.geom_pos[geom], model.geom_quat[geom]
        )
        kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
        if kind == "mesh":
            mesh = self._mesh(model.geom_dataid[geom], pose)
            texture = self._texture(geom) if isinstance(mesh.visual, TextureVisuals) else None
            return Shape("mesh", mesh=mesh, rgba=self._colour(geom, texture), texture=texture)
        if kind not in _SIZES:
            raise InputError(
                f"{self.path}: geom {model.geom(geom).name or geom!r} is a {kind}; "
                f"expected a mesh, {', '.join(_SIZES)}"
            )
        size = tuple(model.geom_size[geom, : _SIZES[kind]].tolist())
        return Shape(kind, size=size, pose=pose, rgba=self._colour(geom, None))  # pyright: ignore[reportArgumentType]

    def _body_pose(self, body: int) -> Float[np.ndarray, "4 4"]:
        """`T_object_body`."""
        base, own = (_pose(self.data.xpos[i], self.data.xquat[i]) for i in (1, body))
        return invert(base) @ own

    def _mesh(self, index: int, pose: Float[np.ndarray, "4 4"]) -> trimesh.Trimesh:
        """A mesh whose vertices as MuJoCo moved them lie at `pose`, in the object frame."""
        model = self.compiled
        placed = pose @ invert(_pose(model.mesh_pos[index], model.mesh_quat[index]))
        file = self._file(model.mesh_pathadr[index])
        if file is not None and self._is_plain(index):
            try:
                loaded = trimesh.load(file, force="mesh", process=False, skip_materials=True)
            except (OSError, ValueError, IndexError, KeyError) as error:
                raise InputError(f"{file}: cannot be read as a mesh ({error})") from None
            mesh = cast(trimesh.Trimesh, loaded)
            if np.allclose(placed, np.eye(4), rtol=0, atol=_ROUNDING):
                return mesh
            return cast(trimesh.Trimesh, mesh.apply_transform(placed))
        return self._compiled_mesh(index, file).apply_transform(pose)

    def _is_plain(self, index: int) -> bool:
        """Whether a mesh is an OBJ whose numbers are metres in the frame of its geom."""
        mesh = self.spec.mesh(self.compiled.mesh(index).name)
        numbers = (*mesh.scale, *mesh.refpos, *mesh.refquat)
        return mesh.file.lower().endswith(".obj") and numbers == (1, 1, 1, 0, 0, 0, 1, 0, 0, 0)

    def _compiled_mesh(self, index: int, file: Path | None) -> trimesh.Trimesh:
        """The vertices as MuJoCo moved them; with texture coordinates, each face has its own."""
        model = self.compiled
        vertices = _rows(model.mesh_vert, model.mesh_vertadr[index], model.mesh_vertnum[index])
        first, count = model.mesh_faceadr[index], model.mesh_facenum[index]
        faces = _rows(model.mesh_face, first, count)
        texcoords = model.mesh_texcoordadr[index]
        if texcoords < 0:
            return trimesh.Trimesh(vertices, faces, process=False)
        uv = model.mesh_texcoord[texcoords + _rows(model.mesh_facetexcoord, first, count).ravel()]
        if file is not None and file.suffix.lower() == ".obj":
            uv = np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1)  # MuJoCo's reader turned them over
        corners = np.arange(faces.size).reshape(-1, 3)
        visual = TextureVisuals(uv=uv)
        return trimesh.Trimesh(vertices[faces.ravel()], corners, visual=visual, process=False)

    def _texture(self, geom: int) -> Path | None:
        """The image on a geom, where it is a file."""
        material = self.compiled.geom_matid[geom]
        if material < 0:
            return None
        texture = self.compiled.mat_texid[material, mujoco.mjtTextureRole.mjTEXROLE_RGB]
        if texture < 0 or self.compiled.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D:
            return None
        return self._file(self.compiled.tex_pathadr[texture])

    def _colour(self, geom: int, texture: Path | None) -> tuple[float, float, float, float]:
        rgba, material = self.compiled.geom_rgba[geom], self.compiled.geom_matid[geom]
        if tuple(rgba) == _UNSTATED and texture is not None:
            return Shape.rgba
        if tuple(rgba) == _UNSTATED and material >= 0:
            rgba = self.compiled.mat_rgba[material]
        r, g, b, a = (round(float(value), 6) for value in rgba)  # MuJoCo has single precision
        return r, g, b, a

    def _file(self, address: int) -> Path | None:
        """A file's place, from where MuJoCo keeps it."""
        if address < 0:
            return None
        paths = bytes(self.compiled.paths)
        return Path(paths[address : paths.index(b"\0", address)].decode())


def _rows(values: np.ndarray, first: int, count: int) -> np.ndarray:
    return np.array(values[first : first + count])


def _pose(position: np.ndarray, quaternion: np.ndarray) -> Float[np.ndarray, "4 4"]:
    return compose(quaternion_to_rotation(quaternion), position)
