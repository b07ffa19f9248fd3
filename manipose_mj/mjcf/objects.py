"""Composer entities of built assets: rigid objects and articulated ones."""

from __future__ import annotations

import mujoco
import numpy as np
from dm_control import composer, mjcf
from jaxtyping import Float, Int

from manipose_mj.assets.asset import MODEL_FILE, Asset
from manipose_mj.assets.model_file import refuse_frames
from manipose_mj.assets.physics import SCENE_CONTACT_TIME
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, pose_to_vector, vector_to_pose

# What a model may state of a compiler's settings to be attached to a scene as it is.
_PLAIN = {"angle": "radian", "autolimits": "true"}
# What reading a model raises; lxml's are SyntaxError.
_UNREADABLE = (OSError, ValueError, LookupError, SyntaxError, mujoco.FatalError)


def scene_model(asset: Asset) -> mjcf.RootElement:
    """An asset's MJCF without what is a scene's own: settings of compiler, options, sizes and looks.

    Raises:
      InputError: It cannot be read, or has a `<frame>`, which dm_control does not know.
    """
    place = f"{asset.place}/{MODEL_FILE}"
    try:
        root = mjcf.from_path(str(asset.model_path))
    except _UNREADABLE:
        root = None  # dm_control knows less MJCF than MuJoCo, which has the last word
    if root is None or not _is_plain(root):
        try:
            root = _rewritten(asset, place)
        except InputError:
            raise
        except _UNREADABLE as error:
            line = " ".join(str(error).split())
            raise InputError(f"{place}: cannot be read: {line}") from None
    for own in (root.option, root.size, root.statistic, root.visual):
        own.remove()
    return root


def _is_plain(root: mjcf.RootElement) -> bool:
    stated = root.compiler.get_attributes()
    return stated.get("angle") == "radian" and stated.items() <= _PLAIN.items()


def _rewritten(asset: Asset, place: str) -> mjcf.RootElement:
    """The model as MuJoCo writes it: in radians, inertias stated; only then scenes may forget its compiler's settings."""
    spec = mujoco.MjSpec.from_file(str(asset.model_path))
    refuse_frames(spec, place)
    spec.compiler.saveinertial = True
    spec.compile()
    root = mjcf.from_xml_string(spec.to_xml(), model_dir=str(asset.folder))
    for setting in root.compiler.get_attributes():
        if setting not in _PLAIN:
            delattr(root.compiler, setting)
    return root


def stiffen(root: mjcf.RootElement, time: float) -> None:
    """Give an object's contacts another time constant [s], where it or a class of its geoms states one."""
    classes = [element.geom for element in root.find_all("default")]
    for geom in (*classes, *root.find_all("geom")):
        if geom.solref is not None:
            geom.solref = [time, 1.0]


class RigidObject(composer.Entity):
    """A rigid asset, to be attached with `arena.add_free_entity`."""

    def _build(self, asset: Asset, name: str | None = None) -> None:
        if asset.kind != "rigid":
            raise InputError(f"{asset.place}: is an {asset.kind} asset; expected a rigid one")
        self.asset = asset
        self._mjcf_root = scene_model(asset)
        self._mjcf_root.model = name or asset.name
        stiffen(self._mjcf_root, SCENE_CONTACT_TIME)
        # The arena's attachment frame carries the free joint instead of the stand-alone model's.
        for joint in self._mjcf_root.find_all("joint"):
            joint.remove()

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The asset's MJCF."""
        return self._mjcf_root

    @property
    def free_joint(self) -> mjcf.Element:
        """The free joint of the frame that the object hangs on."""
        return mjcf.get_frame_freejoint(self._mjcf_root)

    def object_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_object`."""
        return vector_to_pose(np.array(physics.bind(self.free_joint).qpos))

    def label_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_label`."""
        return self.object_pose(physics) @ self.asset.label.pose

    def place(self, physics: mjcf.Physics, pose: Float[np.ndarray, "4 4"]) -> None:
        """Put the object's frame at `T_world_object`, at rest."""
        joint = physics.bind(self.free_joint)
        joint.qpos = pose_to_vector(pose)
        joint.qvel = 0.0

    def speeds(self, physics: mjcf.Physics) -> tuple[float, float]:
        """Linear speed of the frame's origin [m/s] and angular speed [rad/s]."""
        velocity = np.array(physics.bind(self.free_joint).qvel)
        return float(np.linalg.norm(velocity[:3])), float(np.linalg.norm(velocity[3:]))


class ArticulatedObject(composer.Entity):
    """An articulated asset, to be attached with `arena.attach` at a pose that does not change."""

    def _build(self, asset: Asset, name: str | None = None) -> None:
        if asset.kind != "articulated":
            raise InputError(f"{asset.place}: is a {asset.kind} asset; expected an articulated one")
        self.asset = asset
        self._mjcf_root = scene_model(asset)
        self._mjcf_root.model = name or asset.name
        stiffen(self._mjcf_root, SCENE_CONTACT_TIME)

    @property
    def mjcf_model(self) -> mjcf.RootElement:
        """The asset's MJCF."""
        return self._mjcf_root

    def joint(self, part: str) -> mjcf.Element:
        """The joint of a moving part."""
        return self._mjcf_root.find("joint", self.asset.part(part).name)

    def opening(self, physics: mjcf.Physics, part: str) -> float:
        """The joint's position [m or rad]; the lower limit is shut."""
        return float(np.asarray(physics.bind(self.joint(part)).qpos).item())

    def base_pose(self, physics: mjcf.Physics) -> Float[np.ndarray, "4 4"]:
        """`T_world_object`."""
        body = physics.bind(self._mjcf_root.worldbody.body[0])
        return vector_to_pose(np.concatenate([body.xpos, body.xquat]))

    def part_pose(self, physics: mjcf.Physics, part: str) -> Float[np.ndarray, "4 4"]:
        """`T_world_part`; a part's frame is the object frame while its joint is at zero."""
        body = physics.bind(self._mjcf_root.find("body", part))
        return vector_to_pose(np.concatenate([body.xpos, body.xquat]))

    def part_geoms(self, physics: mjcf.Physics, part: str) -> Int[np.ndarray, "geoms"]:
        """Ids of the geoms of a moving part."""
        geoms = self._mjcf_root.find("body", part).find_all("geom")
        return np.asarray(physics.bind(geoms).element_id)

    def handle_pose(self, physics: mjcf.Physics, part: str) -> Float[np.ndarray, "4 4"]:
        """`T_world_handle`, the label of the part's handle.

        Raises:
          InputError: The part has no handle.
        """
        handle = self.asset.part(part).handle
        if handle is None:
            raise InputError(f"{self.asset.place}: part {part!r} has no handle label")
        return self.part_pose(physics, part) @ handle.pose

    def cavity_pose(self, physics: mjcf.Physics, part: str) -> Float[np.ndarray, "4 4"]:
        """`T_world_cavity`: the frame centred in the part's cavity, moving with a drawer.

        Raises:
          InputError: The part has no cavity.
        """
        cavity = self.asset.part(part).cavity
        if cavity is None:
            raise InputError(
                f"{self.asset.place}: part {part!r} has no cavity to store anything in"
            )
        carrier = (
            self.part_pose(physics, part) if cavity.moves_with_part else self.base_pose(physics)
        )
        return carrier @ compose(np.eye(3), cavity.center)
