"""Somebody's estimator as `EstimatedPerception` asks it: the observation of a camera's view."""

from __future__ import annotations

from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.control.perception.objects.object_views import ObjectView
from manipose_mj.estimators.answer import EstimatorFailedError
from manipose_mj.estimators.observation import object_observation
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.failures import StageFailure
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate

_REACH = (
    10.0  # of an origin from what is seen, and of an object; no object on a table is near it [m]
)
_CLOUDS = 10.0  # times the length of the cloud, beside it


class ForeignEstimator:
    """Asks a service about objects of one category."""

    def __init__(self, service: EstimatorService, category: str) -> None:
        self._service, self._category = service, category

    def estimate(self, cloud: ObjectView, *, key: Any) -> PoseEstimate:
        """The pose of the object in a view.

        Raises:
          StageFailure: Of the stage `perception`: the estimator failed, or its answer cannot be about what is seen.
          ServerLostError: Its server is there no more.
        """
        import jax  # whose keys perception draws

        image = cloud.image
        observation = object_observation(
            category=self._category,
            points=cloud.points,
            normals=cloud.normals,
            depth=image.depth,
            rgb=image.rgb(),
            mask=image.mask,
            intrinsics=image.intrinsics.matrix,
            camera_pose=cloud.T_world_camera,
            seed=int(np.asarray(jax.random.key_data(key)).ravel()[-1]),
            mesh=cloud.mesh,
        )
        try:
            answer = self._service.estimate(observation)
        except EstimatorFailedError as error:
            raise StageFailure("perception", str(error)) from error
        for number, each in enumerate([answer, *answer.hypotheses]):
            if absurd := _absurd(each, cloud.points):
                which = f"hypothesis {number - 1}: " if number else ""
                raise StageFailure("perception", f"estimator {self._service.name}: {which}{absurd}")
        return answer


def _absurd(answer: PoseEstimate, points: Float[np.ndarray, "n 3"]) -> str:
    """Why an answer cannot be about the points, camera frame [m]; empty where it can, and of no points.

    The bounds are wide: an origin may be far outside of what is seen of a large object.
    """
    if not len(points):
        return ""
    points = points.astype(float)
    most = _REACH + _CLOUDS * float(np.linalg.norm(np.ptp(points, axis=0)))
    distance = float(np.linalg.norm(points - answer.pose[:3, 3], axis=1).min())
    if distance > most:
        return (
            f"the pose is {distance:.3g} m from the object's points; "
            f"expected T_camera_label in metres, at most {most:.3g} m from them"
        )
    longest = float(answer.extents.max())  # NaN where nobody said
    if longest > most:
        return f"extents are up to {longest:.3g} m; expected metres, at most {most:.3g} m"
    return ""
