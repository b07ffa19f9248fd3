"""Which grasps of an object the arm can use where: what regrasping is planned on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from manipose_mj.control.grasping.candidates import MIN_CLEARANCE, object_grasps, postures
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.table_places import rest_of
from manipose_mj.control.scene.collision_query import CONTACT, CollisionQuery
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, SceneEstimate
from manipose_mj.mjcf.panda.robot import MAX_OPENING
from manipose_mj.poses import compose, invert

_OPEN = replace(CONTACT, arm=0.002, target=0.0)
_FROM_BELOW = 0.35  # the upward part of an approach from which on nothing is tried
_TURNS = 8  # of an axis of symmetry
_BLOCK = 96  # poses whose inverse kinematics are solved at once
_POSTURES = 3  # of the arm at a grasp, where few are free
_FEW = 12  # grasps
ENOUGH = 8  # grasps found from which on the rest need not be looked at


class GraspTable:
    """The annotated grasps of one object, and whether they can be had with the object elsewhere.

    Attributes:
      clear: `(n, s)`, whether a grasp is clear of a plane in each stable pose.
    """

    def __init__(
        self, planner: MotionPlanner, estimate: SceneEstimate, obj: ObjectEstimate
    ) -> None:
        """Looks at nothing yet."""
        self._planner, self._estimate, self._object = planner, estimate, obj
        grasps = object_grasps(obj)
        self._openings = grasps.openings
        self._label_tcp = invert(obj.label_pose) @ grasps.tcp_poses
        narrow = obj.grasps.widths <= MAX_OPENING - MIN_CLEARANCE
        self.clear = np.repeat(obj.grasps.clear[narrow].astype(bool), 2, axis=0)

    def clear_at(self, label_pose: Float[np.ndarray, "4 4"]) -> Bool[np.ndarray, "n"]:
        """Which are clear of what the object rests on at `label_pose`; all, if it rests on no side."""
        rest = rest_of(self._object, label_pose[:3, :3])
        return np.ones(len(self), bool) if rest is None else self.clear[:, rest]

    def __len__(self) -> int:
        return len(self._openings)

    def usable(
        self,
        label_pose: Float[np.ndarray, "4 4"],
        among: Bool[np.ndarray, "n"],
        *,
        as_it_lies: bool = False,
        enough: int = ENOUGH,
    ) -> Bool[np.ndarray, "n"]:
        """Which grasps are in reach and free of collision with the object at `label_pose`.

        Args:
          label_pose: `T_world_label`.
          among: The grasps to look at.
          as_it_lies: Without the turns that symmetry allows.
          enough: Stop at so many.
        """
        found = np.zeros(len(self), bool)
        chosen = np.flatnonzero(among)
        turns = np.eye(3)[None]
        if not as_it_lies:
            turns = self._object.label.symmetry.sampled(_TURNS)
        poses = label_pose @ compose(turns, np.zeros((len(turns), 3)))
        tcp_poses = (poses[:, None] @ self._label_tcp[chosen]).reshape(-1, 4, 4)
        owner = np.tile(chosen, len(turns))
        turn = np.repeat(np.arange(len(turns)), len(chosen))
        likely = np.flatnonzero((tcp_poses[:, 2, 2] < _FROM_BELOW) & (tcp_poses[:, 2, 3] > 0))
        # Neighbours fail together: a few from everywhere tell sooner whether there is one.
        likely = np.random.default_rng(0).permutation(likely)
        body, scene = self._object.body, self._planner.scene
        objects = poses @ invert(self._object.label.pose)
        for first in range(0, len(likely), _BLOCK):
            block = likely[first : first + _BLOCK]
            reaches = postures(tcp_poses[block], self._estimate.joints)[:_POSTURES]
            for rank, reach in enumerate(reaches):
                if rank and found.sum() >= min(enough, _FEW):
                    break
                for k, joints in zip(block[reach.index], reach.joints, strict=True):
                    grasp = int(owner[k])
                    if found[grasp]:
                        continue
                    moved = self._planner.within(scene.with_body_at(body, objects[turn[k]]))
                    opening = float(self._openings[grasp])
                    query = CollisionQuery(_OPEN, opening=opening, target=self._object.geoms)
                    found[grasp] = not moved.collides(joints, query)
            if found.sum() >= enough:
                break
        return found
