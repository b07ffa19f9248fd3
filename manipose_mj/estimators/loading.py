"""Estimators by name: `package.module:factory`, or `ws://host:port`."""

from __future__ import annotations

from functools import lru_cache

from manipose_mj.estimators.service import EstimatorService, RemoteEstimator
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.user_code import made_by_user
from manipose_mj.wire.address import shown
from manipose_mj.wire.client import is_address


@lru_cache(maxsize=1)
def load_estimator(settings: EstimatorSettings) -> EstimatorService:
    """The estimator of these settings, made once a process.

    Raises:
      InputError: There is no such module or factory, it fails, or what it makes has no method `estimate`; nobody
        answers at the address.
    """
    if is_address(settings.name):
        return EstimatorService(shown(settings.name), RemoteEstimator(settings.name))
    estimator = made_by_user(settings.name, "--estimator", settings.keywords, ("estimate",))
    return EstimatorService(settings.name, estimator)
