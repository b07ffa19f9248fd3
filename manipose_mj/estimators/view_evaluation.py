"""Somebody's estimator over the views of a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import numpy as np

from manipose_mj.errors import InputError
from manipose_mj.estimators.answer import EstimatorFailedError
from manipose_mj.estimators.observation import Observation, object_observation, sent_mesh
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.ppf_jax.data.pictures import label_mesh
from manipose_mj.ppf_jax.data.view_stream import SeenObject
from manipose_mj.ppf_jax.evaluation.pose_predictions import Predictions
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


def view_observation(seen: SeenObject, *, seed: int, give_cad: bool) -> Observation:
    """A view as an estimator gets it."""
    own = seen.picture
    return object_observation(
        category=seen.cloud.category,
        points=seen.cloud.points,
        normals=seen.cloud.normals,
        depth=own.depth,
        rgb=own.rgb,
        mask=own.mask,
        intrinsics=own.intrinsics.matrix,
        camera_pose=np.eye(4),
        seed=seed,
        mesh=sent_mesh(label_mesh(seen.subject)) if give_cad else None,
    )


def predict_views(
    service: EstimatorService,
    views: Iterable[SeenObject],
    *,
    give_cad: bool,
    progress: Callable[[str], None] = lambda name: None,
) -> tuple[list[LabelledCloud], Predictions]:
    """The clouds of views, and an estimator's pose for each.

    Args:
      service: The estimator.
      views: At least one.
      give_cad: Whether it gets the object's mesh.
      progress: Told the name of every view that is done.

    Raises:
      InputError: It fails on a view; the message names both.
      ServerLostError: Its server is there no more.
    """
    clouds, found, seconds = [], [], []
    for number, seen in enumerate(views):
        observation = view_observation(seen, seed=number, give_cad=give_cad)
        begin = time.perf_counter()
        try:
            found.append(service.estimate(observation))
        except EstimatorFailedError as error:
            raise InputError(f"{seen.cloud.name}: {error}") from None
        seconds.append(time.perf_counter() - begin)
        clouds.append(seen.cloud)
        progress(seen.cloud.name)
    predictions = Predictions(
        np.stack([each.pose for each in found]),
        np.array([each.confidence for each in found]),
        1e3 * float(np.median(seconds)),
    )
    return clouds, predictions
