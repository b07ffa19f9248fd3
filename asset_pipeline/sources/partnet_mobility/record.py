"""What the other files of a PartNet-Mobility object say, compared with its URDF and meshes.

The data set says most things twice: `bounding_box.json` has the extent of the meshes, `mobility_v2.json` the
parts, motions, axes and limits of the links, and every mesh is placed where it was drawn. All of it holds to
1e-5 on the 17 objects at hand, so what does not hold was damaged. The URDF is what is built; differences
are logged.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from asset_pipeline.sources.partnet_mobility.urdf import Urdf, UrdfJoint
from manipose_mj.errors import InputError

log = logging.getLogger(__name__)

# Objects are published with a diagonal of 1.7 to 2.2, twice the unit sphere's radius.
USUAL_DIAGONAL = (1.0, 4.0)
# Beyond, the numbers are garbage rather than another unit.
MAX_DIAGONAL = (1e-4, 1e4)
TOLERANCE = 2e-3  # of positions, for an object of size 2; published are 6 decimals
LIMIT_TOLERANCE = 0.01  # of a joint's travel
MOTIONS = {
    "revolute": ("hinge",),
    "continuous": ("hinge",),
    "prismatic": ("slider", "slider+"),
    "fixed": ("heavy", "static", "fixed", "free", "junk"),
}

# What looking things up in a JSON document raises that is not what was expected.
_MALFORMED = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


@dataclass(frozen=True)
class Semantics:
    """A line of `semantics.txt`: how a link moves (hinge, slider, slider+, heavy, static, free) and
    its name."""

    motion: str
    name: str


def compare_links(folder: Path, urdf: Urdf, semantics: dict[str, Semantics]) -> None:
    """Log where `mobility_v2.json`, where it is there, `semantics.txt` and the URDF disagree."""
    for mismatch in (*_placements(urdf), *_semantics(urdf, semantics)):
        log.warning("%s: %s", folder, mismatch)
    path = folder / "mobility_v2.json"
    if not path.is_file():
        return
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        entries = {f"link_{entry['id']}": entry for entry in document}
        for mismatch in _entries(urdf, entries):
            log.warning("%s: %s", path, mismatch)
    except (*_MALFORMED, OSError) as error:
        log.warning("%s: limits cannot be compared (%s)", path, error)


def compare_size(folder: Path, bounds: Float[np.ndarray, "2 3"]) -> None:
    """Compare the extent of the meshes with what is usual and with `bounding_box.json`, where there is one.

    Args:
      folder: The object's.
      bounds: Of all meshes, every joint at zero, in the frame below the base joint: as drawn.

    Raises:
      InputError: Nothing that was drawn as a model has such a size.
    """
    diagonal = float(np.linalg.norm(np.clip(bounds[1] - bounds[0], -1e100, 1e100)))
    if not MAX_DIAGONAL[0] <= diagonal <= MAX_DIAGONAL[1]:
        raise InputError(
            f"{folder}: the meshes have a diagonal of {diagonal:.3g}; expected about 2, as published"
        )
    if not USUAL_DIAGONAL[0] <= diagonal <= USUAL_DIAGONAL[1]:
        log.warning(
            "%s: the meshes have a diagonal of %.3g where published ones have 2: another unit? The size "
            "is that of the category all the same", folder, diagonal,
        )  # fmt: skip
    path = folder / "bounding_box.json"
    if not path.is_file():
        return
    try:
        stated = json.loads(path.read_text(encoding="utf-8"))
        stated = np.array([stated["min"], stated["max"]], float)
        if np.abs(stated - bounds).max() <= TOLERANCE:
            return
        log.warning("%s: says the object reaches from %s to %s, its meshes from %s to %s; is one damaged?",
                    path, *(np.round(row, 3).tolist() for row in (*stated, *bounds)))  # fmt: skip
    except (*_MALFORMED, OSError) as error:
        log.warning("%s: the size cannot be compared (%s)", path, error)


def _placements(urdf: Urdf) -> Iterator[str]:
    """Visuals that are not, with every joint at zero, where they were drawn."""
    top = next((j.pose for j in urdf.joints.values() if j.parent == urdf.root), np.eye(4))
    for link, visuals in urdf.visuals.items():
        if link == urdf.root:
            continue
        off = [v.file for v in visuals if not _near(pose_of(urdf.chain(link)) @ v.pose, top)]
        if off:
            more = f" and {len(off) - 1} more" if len(off) > 1 else ""
            yield f"mesh {off[0]}{more} of link {link!r} is not where it was drawn; an origin is wrong"


def _semantics(urdf: Urdf, semantics: dict[str, Semantics]) -> Iterator[str]:
    links = set(urdf.visuals) - {urdf.root}
    if lacking := sorted(links - semantics.keys()):
        yield f"semantics.txt does not say what link {lacking[0]!r} is; told by its joint and parts"
    if foreign := sorted(semantics.keys() - links):
        yield f"semantics.txt names {foreign[0]!r}, which is no link"
    for link, joint in urdf.joints.items():
        if link in semantics and not _moves_like(joint, semantics[link].motion):
            yield f"link {link!r} is {semantics[link].motion!r} in semantics.txt; its joint is {joint.kind}"


def _entries(urdf: Urdf, entries: dict[str, Any]) -> Iterator[str]:
    """Where the entries of `mobility_v2.json`, by link, disagree with the URDF."""
    links = urdf.joints
    if lacking := sorted(links.keys() - entries.keys()):
        yield f"has no entry for {len(lacking)} of {len(links)} links; they are not compared"
    if foreign := sorted(entries.keys() - links.keys()):
        yield f"has an entry for {foreign[0]!r}, which is no link"
    for link, joint in links.items():
        entry = entries.get(link, {})
        if "joint" in entry and not _moves_like(joint, entry["joint"]):
            yield f"link {link!r} is {entry['joint']!r}; its joint in the URDF is {joint.kind}"
        if "parts" in entry:
            stated = {f"{part['name']}-{part['id']}" for part in entry["parts"]}
            if odd := sorted(stated ^ {visual.name for visual in urdf.visuals[link]}):
                yield f"it and the URDF do not name the same parts of link {link!r}: {odd[0]!r}"
        data = entry.get("jointData") or {}
        if axis := data.get("axis"):
            yield from _axis(urdf, link, np.array(axis["origin"], float), np.array(axis["direction"], float))  # fmt: skip
        if limit := data.get("limit"):
            yield from _limits(link, joint, limit)


def _axis(
    urdf: Urdf, link: str, origin: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
) -> Iterator[str]:
    """Whether a moving link's axis lies where the record says, in the frame of the drawing."""
    chain = urdf.chain(link)
    if chain[-1].kind not in ("revolute", "continuous", "prismatic"):
        return
    pose = np.linalg.inv(chain[0].pose) @ pose_of(chain)
    own = pose[:3, :3] @ chain[-1].axis
    # The record counts either way round.
    along = min(np.abs(own - direction).max(), np.abs(own + direction).max())
    if not (along <= TOLERANCE and np.abs(pose[:3, 3] - origin).max() <= TOLERANCE):
        yield f"the axis of link {link!r} is not the URDF's, which is taken"


def _limits(link: str, joint: UrdfJoint, limit: dict[str, Any]) -> Iterator[str]:
    """Whether a link moves as far; the record counts hinges in degrees."""
    if joint.limits is None or limit.get("noLimit"):
        return
    span = abs(float(limit["b"]) - float(limit["a"]))
    if joint.kind == "revolute":
        span = float(np.deg2rad(span))
    own = joint.limits[1] - joint.limits[0]
    if not abs(span - own) <= LIMIT_TOLERANCE * max(span, own):
        yield f"link {link!r} moves by {span:g}, in the URDF by {own:g}; the URDF's is taken"


def _moves_like(joint: UrdfJoint, motion: str) -> bool:
    return not motion or joint.kind not in MOTIONS or motion in MOTIONS[joint.kind]


def _near(a: Float[np.ndarray, "4 4"], b: Float[np.ndarray, "4 4"]) -> bool:
    return bool(np.abs(a - b).max() <= TOLERANCE)


def pose_of(chain: list[UrdfJoint]) -> Float[np.ndarray, "4 4"]:
    """`T_root_link` with every joint at zero."""
    pose = np.eye(4)
    for joint in chain:
        pose = pose @ joint.pose
    return pose
