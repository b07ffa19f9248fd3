"""On which faces a convex body comes to rest, and how likely it is to, without any dynamics.

The quasi-static model of Goldberg et al., "Part pose statistics" (IEEE T-RA 1999): a body in a random
orientation meets the ground with the face behind which its centre of mass sees it, and rolls on over
one edge after another until the centre of mass stands over the face it lies on. It gives the same as
`trimesh.poses.compute_stable_poses`, for all faces at once; but where the centre of mass stands exactly
behind a corner, rounding decides in both onto which face the body rolls.
"""

from __future__ import annotations

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Int

SAME_FACE = 3  # decimals of the normals of triangles that are one face


def resting_faces(
    hull: trimesh.Trimesh, center_of_mass: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k"]]:
    """Outward normals of the faces on which a body rests, and the probability of each.

    Args:
      hull: Convex, closed, normals outwards [m].
      center_of_mass: `(3,)`, inside it [m].

    Returns:
      Unit normals, in the order of the hull's triangles, and probabilities that sum to one.
    """
    normals = np.asarray(hull.face_normals)
    corners = np.asarray(hull.triangles) - center_of_mass
    ends = _ends(_next_faces(hull, corners, normals))
    share = np.bincount(ends, _landing_shares(corners), minlength=len(normals))
    rest = np.flatnonzero(share)
    _, first, face = np.unique(
        normals[rest].round(SAME_FACE), axis=0, return_index=True, return_inverse=True
    )
    order = np.argsort(first)
    probabilities = np.bincount(face.ravel(), share[rest])
    return normals[rest[first[order]]], probabilities[order]


def rest_rotation(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """A rotation `R_world_object` that turns this outward normal of a face straight down."""
    z = -normal
    x = np.array([-z[1], z[0], 0.0])
    x = x / np.linalg.norm(x) if x.any() else np.array([1.0, 0.0, 0.0])
    y = np.cross(z, x)
    return np.array([x, y / np.linalg.norm(y), z])


def _landing_shares(corners: Float[np.ndarray, "f 3 3"]) -> Float[np.ndarray, "f"]:
    """The share of all directions in which the origin sees each triangle.

    The solid angle by Van Oosterom and Strackee (IEEE T-BME 1983).
    """
    a, b, c = (corners / np.linalg.norm(corners, axis=2, keepdims=True)).transpose(1, 0, 2)
    volume = (a * np.cross(b, c)).sum(axis=1)
    cosines = 1 + (a * b).sum(axis=1) + (b * c).sum(axis=1) + (c * a).sum(axis=1)
    return np.abs(np.arctan2(volume, cosines)) / (2 * np.pi)


def _next_faces(
    hull: trimesh.Trimesh, corners: Float[np.ndarray, "f 3 3"], normals: Float[np.ndarray, "f 3"]
) -> Int[np.ndarray, "f"]:
    """The face onto which a body that lies on each rolls; the same one where it stays."""
    own = np.arange(len(normals))
    middle = corners.mean(axis=1)
    # Where the centre of mass, the origin, stands over each face's plane.
    foot = (corners[:, 0] * normals).sum(axis=1)[:, None] * normals - middle
    arms = corners - middle[:, None]
    # Three rays from the middle through the corners part the plane; `turned[k]` is positive on the
    # far side of ray k, counterclockwise.
    turned = (np.cross(arms, foot[:, None]) * normals[:, None]).sum(axis=2)
    # Across the edge opposite corner k lie the points between rays k + 1 and k + 2.
    sector = np.minimum(np.roll(turned, -1, axis=1), -np.roll(turned, -2, axis=1)).argmax(axis=1)
    return np.where(_inside(arms, foot, normals), own, _neighbours(hull)[own, sector])


def _inside(
    arms: Float[np.ndarray, "f 3 3"],
    foot: Float[np.ndarray, "f 3"],
    normals: Float[np.ndarray, "f 3"],
) -> Bool[np.ndarray, "f"]:
    """Whether each foot, from the middle of its triangle as the corners are, lies in it."""
    edges = np.roll(arms, -1, axis=1) - arms
    left = (np.cross(edges, foot[:, None] - arms) * normals[:, None]).sum(axis=2)
    return (left >= 0).all(axis=1)


def _neighbours(hull: trimesh.Trimesh) -> Int[np.ndarray, "f 3"]:
    """The triangle across the edge opposite each corner."""
    faces = np.asarray(hull.faces)
    found = np.repeat(np.arange(len(faces))[:, None], 3, axis=1)
    pairs, alone = np.asarray(hull.face_adjacency), np.asarray(hull.face_adjacency_unshared)
    for here, there in ((0, 1), (1, 0)):
        corner = (faces[pairs[:, here]] == alone[:, here, None]).argmax(axis=1)
        found[pairs[:, here], corner] = pairs[:, there]
    return found


def _ends(following: Int[np.ndarray, "f"]) -> Int[np.ndarray, "f"]:
    """Where each face's rolling ends.

    Twice as far with every look; triangles of one face between which rounding sends the body to and
    fro are one place to rest.
    """
    for _ in range(int(len(following)).bit_length()):
        following = following[following]
    return following
