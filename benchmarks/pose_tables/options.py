"""What tables of poses are about and where they go, checked before anything is rendered; their rows as JSON."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from manipose_mj.cli.pose.train import WEIGHTS_FILE
from manipose_mj.errors import InputError
from manipose_mj.ppf_jax.data.view_settings import ViewSetting, view_setting
from manipose_mj.ppf_jax.estimator import PoseEstimator
from manipose_mj.ppf_jax.evaluation.pose_predictions import RIGID_TYPES, categories_of
from manipose_mj.storage.staging import replacing


def one_camera_setting(name: str) -> ViewSetting:
    """The setting of this name, for networks that look from one point.

    Raises:
      InputError: There is none, or several cameras look at once in it.
    """
    setting = view_setting(name)
    if setting.cameras != (1, 1):
        raise InputError(
            f"setting {name!r} is of several cameras, the networks of this table of one; "
            f"`manipose pose evaluate NAME --setting {name}` measures those of several"
        )
    return setting


def check_categories(names: Iterable[str]) -> None:
    """Raises InputError for what is no rigid category; a type is none."""
    for name in names:
        if name in RIGID_TYPES:
            raise InputError(
                f"{name} is a type; expected categories, such as {categories_of(name)[0]}"
            )
        categories_of(name)


def network_of(name: str, weights: Path | None) -> PoseEstimator:
    """The network of a category or type: the package's, or that of a folder of trainings.

    Raises:
      InputError: There is none.
    """
    if weights is None:
        return PoseEstimator.load(name)
    return PoseEstimator.from_file(weights / name / WEIGHTS_FILE)


def check_files(*paths: Path | None) -> None:
    """Raises InputError for a file that cannot be written; None is no file."""
    for path in paths:
        if path is not None:
            if path.is_dir():
                raise InputError(f"{path}: is a folder; expected a file to write")
            _check_folder(path, path.absolute().parent)


def check_folder(path: Path | None) -> None:
    """Raises InputError for a folder that cannot be written; None is no folder."""
    if path is not None:
        _check_folder(path, path.absolute())


def write_rows(path: Path, rows: Sequence[Any]) -> None:
    """Write rows as JSON, whole or not at all.

    Raises:
      InputError: The file cannot be written.
    """
    text = json.dumps(rows, indent=1) + "\n"
    try:
        if path.exists() and not path.is_file():  # such as /dev/stdout
            path.write_text(text, encoding="utf-8")
            return
        with replacing(path.resolve()) as scratch:
            scratch.write_text(text, encoding="utf-8")
    except OSError as error:
        raise _unwritable(path, error) from None


def _check_folder(path: Path, folder: Path) -> None:
    there = next(each for each in (folder, *folder.parents) if each.exists())
    try:
        with tempfile.TemporaryDirectory(dir=there):
            pass
    except OSError as error:
        raise _unwritable(path, error) from None


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({error.strerror or error}); give another place")
