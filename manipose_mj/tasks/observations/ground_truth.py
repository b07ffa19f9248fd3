"""Which observations tell what only a simulator knows: true poses, or true instance masks; loads nothing.

| observation | tells | why |
|---|---|---|
| `pose/...` | true poses | objects, goals, handles, joint axes and openings, read from the state |
| `pose/symmetry/...`, `symmetry_count/...`, `axial/...`, `bounds/...`, `counts/...` | neither | what holds in any pose: symmetry, size, and what a goal asks for |
| `segmentation/...` | true instance masks | which pixel belongs to which object |
| `pointcloud/points`, `pointcloud/colours` | neither | a depth image and its colours, as a sensor gives them |
| all other `pointcloud/...` | true instance masks | the points' instances, a cloud of each object; normals are fitted within an object's mask |
| `rgb/...`, `depth/...`, `camera/...`, the robot's own | neither | a sensor, or calibration |
"""

from __future__ import annotations

from dataclasses import dataclass

_POSELESS = ("symmetry", "symmetry_count", "axial", "bounds", "counts")
_MASKLESS = ("pointcloud/points", "pointcloud/colours")


@dataclass(frozen=True)
class GroundTruth:
    """What observations tell truly.

    Attributes: poses: of objects, furniture or goals; masks: which pixel or point is which object's.
    """

    poses: bool = False
    masks: bool = False


def told_by(observation: str) -> GroundTruth:
    """What one mode or key tells truly.

    Args:
      observation: Such as `"pose"`, which is all of its keys, or `"pointcloud/points"`.
    """
    mode, *rest = observation.split("/")
    if mode == "pose":
        return GroundTruth(poses=not rest or rest[0] not in _POSELESS)
    if mode in ("segmentation", "pointcloud"):
        return GroundTruth(masks=observation not in _MASKLESS)
    return GroundTruth()


def told_by_all(obs_mode: str) -> GroundTruth:
    """What an observation mode tells truly.

    Args:
      obs_mode: Modes and keys joined by `+`.
    """
    told = [told_by(part) for part in obs_mode.split("+")]
    return GroundTruth(any(each.poses for each in told), any(each.masks for each in told))
