"""Estimators by name: `package.module:factory`, or `ws://host:port`."""

from __future__ import annotations

import importlib
import os
import sys
from functools import lru_cache
from typing import Any

from manipose_mj.errors import InputError, unknown_name
from manipose_mj.estimators.service import EstimatorService, RemoteEstimator
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.wire.client import is_address


@lru_cache(maxsize=1)
def load_estimator(settings: EstimatorSettings) -> EstimatorService:
    """The estimator of these settings, made once a process.

    Raises:
      InputError: There is no such module or factory, it fails, or what it makes has no method `estimate`; nobody
        answers at the address.
    """
    option = f"--estimator {settings.name}"
    if is_address(settings.name):
        return EstimatorService(settings.name, RemoteEstimator(settings.name))
    factory = _factory(settings.name, option)
    try:
        estimator = factory(**settings.keywords)
    except Exception as error:  # whatever a stranger's code raises
        raise InputError(f"{option}: its factory failed ({_line(error)})") from error
    if not callable(getattr(estimator, "estimate", None)):
        made = type(estimator).__name__
        raise InputError(f"{option}: the {made} that it makes has no method estimate")
    return EstimatorService(settings.name, estimator)


def _factory(name: str, option: str) -> Any:
    module_name, _, attribute = name.partition(":")
    if not module_name or not attribute:
        raise InputError(f"{option}: expected package.module:factory or ws://host:port")
    # As `python -m` does: modules of the folder at hand are found.
    if "" not in sys.path and os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        found: Any = importlib.import_module(module_name)
    except Exception as error:  # of a module that is not there, and of one that fails
        raise InputError(f"{option}: cannot import {module_name} ({_line(error)})") from error
    for part in attribute.split("."):
        if not hasattr(found, part):
            public = [each for each in dir(found) if not each.startswith("_")]
            raise unknown_name(f"factory of {module_name}", part, public)
        found = getattr(found, part)
    if not callable(found):
        raise InputError(f"{option}: {attribute} cannot be called; expected a class or function")
    return found


def _line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())[:300]
