"""Somebody's estimator as `EstimatedPerception` asks it: the observation of a camera's view."""

from __future__ import annotations

from typing import Any

import numpy as np

from manipose_mj.control.perception.objects.object_views import ObjectView
from manipose_mj.estimators.answer import EstimatorFailedError
from manipose_mj.estimators.observation import object_observation
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.failures import StageFailure
from manipose_mj.ppf_jax.pose_estimate import PoseEstimate


class ForeignEstimator:
    """Asks a service about objects of one category."""

    def __init__(self, service: EstimatorService, category: str) -> None:
        self._service, self._category = service, category

    def estimate(self, cloud: ObjectView, *, key: Any) -> PoseEstimate:
        """The pose of the object in a view.

        Raises:
          StageFailure: Of the stage `perception`: the estimator failed.
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
            return self._service.estimate(observation)
        except EstimatorFailedError as error:
            raise StageFailure("perception", str(error)) from error
