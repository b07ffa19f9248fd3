"""The estimators and the server of `docs/guides/own_estimator.md` work as they stand there."""

from __future__ import annotations

from threading import Thread

import numpy as np
import pytest
from websockets.sync.server import serve

from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.service import EstimatorService
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.estimators.view_evaluation import predict_views, view_observation
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.data.view_stream import catalogue_views
from tests.docs.pages import DOCS, blocks


@pytest.fixture(scope="module")
def guide() -> dict:
    """What the guide's blocks define, but for the last one, which loads a task."""
    names: dict = {"np": np}
    for block in blocks(DOCS / "guides" / "own_estimator.md", "python"):
        if "suite.load" not in block.code:
            exec(block.code, names)
    return names


@pytest.fixture(scope="module")
def views():
    return list(catalogue_views("mug", 4, view_setting("anywhere"), 2))


def test_the_server_answers_as_its_estimator_does(guide, views):
    with serve(guide["answer_all"], "127.0.0.1", 0, compression=None, max_size=None) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        load_estimator.cache_clear()
        port = server.socket.getsockname()[1]
        service = load_estimator(EstimatorSettings(f"ws://127.0.0.1:{port}"))
        assert service.estimator.metadata == {"name": "median"}
        here = EstimatorService("here", guide["MedianEstimator"]())
        for seen in views:
            observation = view_observation(seen, seed=0, give_cad=True)
            one, other = service.estimate(observation), here.estimate(observation)
            np.testing.assert_array_equal(one.pose, other.pose)
            assert one.confidence == other.confidence == 0.1
        load_estimator.cache_clear()
        server.shutdown()
        thread.join()


def test_the_example_of_another_package_finds_the_object(guide, views):
    pytest.importorskip("small_gicp")
    service = EstimatorService("icp", guide["MultiStartICP"]())
    clouds, found = predict_views(service, views, give_cad=True)
    for pose, cloud in zip(found.poses, clouds, strict=True):
        assert np.linalg.norm(pose[:3, 3] - cloud.pose[:3, 3]) < 0.03
