"""From the cloud of a piece of furniture to its parts, as the baseline sees them: `FurnitureEstimator.load()`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float, PRNGKeyArray

from manipose_mj.control.furniture.fit.furniture_fit import fit_furniture
from manipose_mj.control.furniture.sensing.part_sensing import sensed_furniture
from manipose_mj.control.furniture.sensing.scene_cloud import SceneCloud
from manipose_mj.control.furniture.shapes.furniture_model import FurnitureModel
from manipose_mj.errors import InputError
from manipose_mj.poses import compose, invert, transform
from manipose_mj.ppf_jax.articulated_estimator import (
    CAMERA_UP,
    ArticulatedEstimator,
    PartEstimate,
    Row,
    checked_furniture,
    estimate_rows,
)
from manipose_mj.ppf_jax.points.cloud_input import AnyCloud, Cloud, seeds_of

_LEANS = 0.5  # cosine between the body's own up and that of the camera, at least


@dataclass(frozen=True)
class FurnitureEstimator:
    """The network of handles and joints, and the fit of furniture to all points of the cloud.

    The fit moves handles to what stands out of the front, hinges to the edges of their panels, and adds handles that the
    network missed. It knows how furniture of a category is made; `ArticulatedEstimator` is the network alone.

    Attributes:
      network: Its estimates are fitted.
    """

    network: ArticulatedEstimator

    @classmethod
    def load(cls) -> FurnitureEstimator:
        """The one that the baseline sees furniture with.

        Raises:
          InputError: The network's weights are missing.
        """
        return cls(ArticulatedEstimator.load())

    def estimate(
        self,
        cloud: AnyCloud,
        category: str,
        *,
        key: PRNGKeyArray,
        up: Sequence[float] = CAMERA_UP,
        least: float = 0.1,
    ) -> list[PartEstimate]:
        """The handles and joints that a cloud shows, the surest first; arguments as of `estimate_many`.

        Raises:
          InputError: The cloud is no cloud of furniture in metres; one line says why.
        """
        return self.estimate_many([cloud], [category], key=key, up=up, least=least)[0]

    def estimate_many(
        self,
        clouds: Sequence[AnyCloud],
        categories: Sequence[str],
        *,
        key: PRNGKeyArray,
        up: Sequence[float] = CAMERA_UP,
        least: float = 0.1,
    ) -> list[list[PartEstimate]]:
        """The same for many clouds, one after the other but for the network.

        Args:
          clouds: As of `ArticulatedEstimator`.
          categories: One for each. `"dishwasher"`, `"microwave"`, `"oven"` and `"washing_machine"` have knobs; doors of
            `"cabinet"`, `"microwave"` and `"oven"` open as far as is usual for them. Any other name, a misspelt one
            too, stands for furniture without knobs whose doors open by 100 deg.
          key: Of all that is drawn; the same key gives the same answer.
          up: Roughly which way is up in the camera frame, within some 60 deg.
          least: Confidence from which on a part is reported.

        Raises:
          InputError: One of the clouds cannot be used, or clouds and categories are not as many.
        """
        if len(clouds) != len(categories):
            raise InputError(
                f"{len(clouds)} clouds and {len(categories)} categories; expected one each"
            )
        seeds_of(key)
        checked = []
        for number, cloud in enumerate(clouds):
            try:
                checked.append(Cloud(*checked_furniture(cloud, jax.random.fold_in(key, number))))
            except InputError as error:
                raise InputError(
                    f"cloud {number}: {error}" if len(clouds) > 1 else str(error)
                ) from None
        rows = estimate_rows(self.network.model, checked, key=key, up=up)
        found = []
        for cloud, category, row in zip(checked, categories, rows, strict=True):
            camera_pose = _level(row, np.asarray(up, float))
            model = _fitted(cloud, category, row, camera_pose)
            found.append(_parts(model, invert(camera_pose), least))
        return found


def _level(row: Row, up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """`T_level_camera`: about the camera, Z up as the body stands."""
    up = up / np.linalg.norm(up)
    z = row["body"][:, 1].astype(float)
    z = z * np.sign(z @ up)
    z = z / np.linalg.norm(z) if z @ up > _LEANS * np.linalg.norm(z) else up
    # Any level X: the fit finds the front.
    x = row["body"][:, 0].astype(float)
    x = x - (x @ z) * z
    if np.linalg.norm(x) < 1e-3:
        x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
    x = x / np.linalg.norm(x)
    return compose(np.stack([x, np.cross(z, x), z]), np.zeros(3))


def _fitted(
    cloud: Cloud, category: str, row: Row, camera_pose: Float[np.ndarray, "4 4"]
) -> FurnitureModel:
    points = transform(camera_pose, cloud.points.astype(float))
    normals = cloud.normals.astype(float) @ camera_pose[:3, :3].T
    level = SceneCloud(points, normals, np.zeros(len(points), int))
    return fit_furniture(level, sensed_furniture(row, camera_pose), category)


def _parts(
    model: FurnitureModel, camera_level: Float[np.ndarray, "4 4"], least: float
) -> list[PartEstimate]:
    """Of a model in the level frame, in the camera's."""
    pose = camera_level @ model.pose
    parts = []
    for part in model.parts:
        joint, handle = part.part.joint, part.part.handle
        if part.confidence < least or handle is None:
            continue
        parts.append(
            PartEstimate(
                handle=pose @ part.motion(part.opening) @ handle.pose,
                joint="hinge" if joint.kind == "hinge" else "slide",
                axis_origin=transform(pose, joint.origin[None])[0],
                axis=pose[:3, :3] @ joint.axis,
                opening=float(part.opening),
                confidence=float(part.confidence),
            )
        )
    return sorted(parts, key=lambda part: -part.confidence)
