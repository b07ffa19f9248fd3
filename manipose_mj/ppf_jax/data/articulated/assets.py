"""Scenes of built furniture, such as PartNet-Mobility's."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from pathlib import Path

import joblib
import numpy as np

from manipose_mj.assets.asset import Asset
from manipose_mj.assets.asset_json import list_assets, read_asset
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.ppf_jax.data.articulated.cache import random_scene
from manipose_mj.ppf_jax.data.articulated.clouds import FurnitureScene
from manipose_mj.ppf_jax.data.articulated.subject import asset_furniture
from manipose_mj.ppf_jax.data.articulated.views import FURNITURE_SETTINGS


def asset_scenes(
    directory: Path,
    setting: str,
    *,
    scenes: int,
    jobs: int = 1,
    only: Sequence[str] | None = None,
) -> list[FurnitureScene]:
    """Scenes of the articulated assets in a folder that have a part with a handle.

    Args:
      directory: Of asset folders.
      setting: A name in `FURNITURE_SETTINGS`.
      scenes: Of each asset.
      jobs: Processes.
      only: Names of assets; by default all.

    Raises:
      InputError: There is no such asset in the folder, or one cannot be read.
    """
    chosen = [
        asset
        for asset in map(read_asset, list_assets(directory))
        if asset.kind == "articulated" and asset.graspable
    ]
    if only is not None:
        names = [asset.name for asset in chosen]
        for name in only:
            if name not in names:
                raise unknown_name(f"articulated asset with a handle in {directory}", name, names)
        chosen = [asset for asset in chosen if asset.name in only]
    if not chosen:
        raise InputError(f"{directory}: no articulated asset with a handle")
    rendered = joblib.Parallel(n_jobs=jobs)(
        joblib.delayed(_scenes)(asset, setting, scenes) for asset in chosen
    )
    return [scene for some in rendered for scene in some]  # pyright: ignore[reportOptionalIterable, reportGeneralTypeIssues]


def _scenes(asset: Asset, setting: str, scenes: int) -> list[FurnitureScene]:
    subject = asset_furniture(asset)
    rng = np.random.default_rng(zlib.crc32(asset.name.encode()))
    return [random_scene(subject, FURNITURE_SETTINGS[setting], i, rng) for i in range(scenes)]
