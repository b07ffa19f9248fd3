"""The part of URDF that data sets of articulated objects use: links of meshes, and a tree of joints.

http://wiki.ros.org/urdf/XML. Read as data from strangers: no document type (so no entities to expand),
no mesh outside the file's folder, no cycles.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.poses import compose

log = logging.getLogger(__name__)

MAX_BYTES = 16 * 2**20
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
LARGEST_ANGLE = 2 * np.pi + 0.01  # of an origin [rad]
MAX_LINKS = 2000


@dataclass(frozen=True)
class UrdfMesh:
    """A visual: its name, its file relative to the URDF, and `T_link_mesh`."""

    name: str
    file: PurePosixPath
    pose: Float[np.ndarray, "4 4"]


@dataclass(frozen=True)
class UrdfJoint:
    """A joint: `pose` is `T_parent_child` at zero, `axis` is unit, in the child's frame.

    `limits` are [m or rad], None where there are none (continuous, fixed and floating joints).
    """

    kind: str
    parent: str
    child: str
    pose: Float[np.ndarray, "4 4"]
    axis: Float[np.ndarray, "3"]
    limits: tuple[float, float] | None


@dataclass(frozen=True)
class Urdf:
    """A robot: the visuals of each link, the joint above each link, and the link with none above."""

    visuals: dict[str, tuple[UrdfMesh, ...]]
    joints: dict[str, UrdfJoint]
    root: str

    def chain(self, link: str) -> list[UrdfJoint]:
        """The joints from the root down to a link."""
        found = []
        while link != self.root:
            joint = self.joints[link]
            found.append(joint)
            link = joint.parent
        return found[::-1]


def read_urdf(path: Path) -> Urdf:
    """Read and check a URDF file.

    Raises:
      InputError: The file is missing, too large or no plain XML; a number or a reference is wrong; a
        mesh path leaves the folder; or the links are not one tree.
    """
    root = _parse(path)
    links = [_attribute(path, link, "name") for link in root.findall("link")]
    if not links or len(links) > MAX_LINKS:
        raise InputError(f"{path}: has {len(links)} links; expected 1 to {MAX_LINKS}")
    if len(set(links)) != len(links):
        raise InputError(f"{path}: two links have the same name; expected unique names")
    visuals = {
        name: tuple(_visual(path, v) for v in link.findall("visual"))
        for name, link in zip(links, root.findall("link"), strict=True)
    }
    joints: dict[str, UrdfJoint] = {}
    for element in root.findall("joint"):
        joint = _joint(path, element)
        for end in (joint.parent, joint.child):
            if end not in visuals:
                raise InputError(f"{path}: a joint names link {end!r}, which is not there")
        if joint.child in joints:
            raise InputError(
                f"{path}: link {joint.child!r} hangs on two joints; expected one tree of links"
            )
        if element.find("mimic") is not None:
            log.warning(
                "%s: link %r follows another joint; it is built to move on its own",
                path,
                joint.child,
            )
        joints[joint.child] = joint
    return _tree(path, visuals, joints)


def mesh_files(path: Path) -> list[PurePosixPath]:
    """The files that the visuals of a URDF name, relative to its folder, sorted.

    Raises:
      InputError: The file is missing, too large or no plain XML; or a visual is not as `read_urdf` expects.
    """
    links = _parse(path).findall("link")
    return sorted({_visual(path, v).file for link in links for v in link.findall("visual")})


def _tree(
    path: Path, visuals: dict[str, tuple[UrdfMesh, ...]], joints: dict[str, UrdfJoint]
) -> Urdf:
    tops = [name for name in visuals if name not in joints]
    if not tops:
        raise InputError(f"{path}: the links form a cycle; expected one tree")
    if len(tops) > 1:
        raise InputError(
            f"{path}: links {', '.join(map(repr, tops[:4]))} hang on nothing; expected one tree"
        )
    reached = set(tops)
    waiting = list(joints)
    while waiting:
        left = [child for child in waiting if joints[child].parent not in reached]
        if len(left) == len(waiting):
            raise InputError(f"{path}: link {left[0]!r} is in a cycle; expected one tree of links")
        reached |= set(waiting) - set(left)
        waiting = left
    return Urdf(visuals, joints, tops[0])


def _parse(path: Path) -> ElementTree.Element:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"{path}: larger than {MAX_BYTES >> 20} MiB; expected a URDF")
        text = path.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: is not UTF-8 text; expected a URDF") from None
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InputError(f"{path}: declares a document type or entities; expected plain XML")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{path}: is not XML ({error})") from None
    if root.tag != "robot":
        raise InputError(f"{path}: the root element is <{root.tag}>; expected <robot>")
    return root


def _of_scale_one(scale: str) -> bool:
    try:
        return [float(each) for each in scale.split()] == [1.0, 1.0, 1.0]
    except ValueError:
        return False


def _visual(path: Path, element: ElementTree.Element) -> UrdfMesh:
    mesh = element.find("geometry/mesh")
    if mesh is None:
        raise InputError(f"{path}: a visual has no mesh; expected <geometry><mesh filename=.../>")
    if not _of_scale_one(mesh.get("scale", "1 1 1")):
        raise InputError(f"{path}: a mesh has scale {mesh.get('scale')!r}; expected none")
    name = _attribute(path, mesh, "filename")
    file = PurePosixPath(name)
    if file.is_absolute() or ".." in file.parts or "\\" in name or "\0" in name or "://" in name:
        raise InputError(f"{path}: mesh {name!r} leaves the folder; expected a path inside it")
    return UrdfMesh(element.get("name", ""), file, _pose(path, element.find("origin")))


def _joint(path: Path, element: ElementTree.Element) -> UrdfJoint:
    kind = _attribute(path, element, "type")
    if kind not in JOINT_TYPES:
        raise InputError(f"{path}: {unknown_name('type of a joint', kind, JOINT_TYPES)}")
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise InputError(f"{path}: a joint lacks its <parent> or <child>; expected both")
    axis = np.array([1.0, 0.0, 0.0])
    if (direction := element.find("axis")) is not None:
        axis = _vector(path, direction, "xyz")
    if np.linalg.norm(axis) < 1e-9:
        raise InputError(f"{path}: a joint's axis is zero; expected a direction")
    limits = None
    limit = element.find("limit")
    if kind in ("revolute", "prismatic"):
        if limit is None:
            raise InputError(f"{path}: a {kind} joint has no <limit>; expected lower and upper")
        lower, upper = (_number(path, limit.get(key, "0"), key) for key in ("lower", "upper"))
        if lower > upper:
            raise InputError(f"{path}: a joint's limits are {lower:g} to {upper:g}; expected order")
        limits = (lower, upper)
    return UrdfJoint(
        kind=kind,
        parent=_attribute(path, parent, "link"),
        child=_attribute(path, child, "link"),
        pose=_pose(path, element.find("origin")),
        axis=axis / np.linalg.norm(axis),
        limits=limits,
    )


def _pose(path: Path, origin: ElementTree.Element | None) -> Float[np.ndarray, "4 4"]:
    if origin is None:
        return np.eye(4)
    rpy = _vector(path, origin, "rpy")
    if np.abs(rpy).max() > LARGEST_ANGLE:
        said = " ".join(f"{angle:g}" for angle in rpy)
        raise InputError(f"{path}: an origin is turned by {said} rad; expected a turn: degrees?")
    return compose(Rotation.from_euler("xyz", rpy).as_matrix(), _vector(path, origin, "xyz"))


def _vector(path: Path, element: ElementTree.Element, key: str) -> Float[np.ndarray, "3"]:
    fields = element.get(key, "0 0 0").split()
    if len(fields) != 3:
        raise InputError(f"{path}: {key}={element.get(key)!r}; expected 3 numbers")
    return np.array([_number(path, f, key) for f in fields])


def _number(path: Path, text: str, key: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}: {key} holds {text!r}; expected a finite number")
    return value


def _attribute(path: Path, element: ElementTree.Element, key: str) -> str:
    value = element.get(key)
    if not value:
        raise InputError(f"{path}: a <{element.tag}> lacks {key!r}; expected one")
    return value
