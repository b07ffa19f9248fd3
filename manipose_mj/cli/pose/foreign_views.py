"""Somebody's estimator over the views that `manipose pose evaluate` shows, with progress on the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from manipose_mj.assets.categories import Split
from manipose_mj.console import output
from manipose_mj.estimators.loading import load_estimator
from manipose_mj.estimators.settings import EstimatorSettings
from manipose_mj.estimators.view_evaluation import predict_views
from manipose_mj.ppf_jax.data.view_settings import view_setting
from manipose_mj.ppf_jax.data.view_stream import (
    SeenObject,
    asset_views,
    catalogue_views,
    split_indices,
)
from manipose_mj.ppf_jax.evaluation.pose_predictions import Predictions
from manipose_mj.ppf_jax.points.clouds import LabelledCloud


class ForeignViews:
    """Asks one estimator about views of one setting."""

    def __init__(self, settings: EstimatorSettings, setting: str, views: int) -> None:
        """Makes the estimator.

        Args:
          settings: Which one.
          setting: From where objects are seen.
          views: Of each object.

        Raises:
          InputError: There is no such estimator or setting.
        """
        self._setting, self._views = view_setting(setting), views
        self._service = load_estimator(settings)
        self._give_cad = settings.give_cad

    def predictions(
        self, category: str, split: Split, assets: Path | None
    ) -> tuple[list[LabelledCloud], Predictions]:
        """Clouds of a category's objects, and the estimator's pose for each.

        Args:
          category: Of the catalogue; with `assets`, a category or a type.
          split: Of the catalogue.
          assets: Folder of assets to look at instead.

        Raises:
          InputError: The estimator fails on a view, or objects cannot be shown so.
        """
        if assets is None:
            total: int | None = self._views * len(split_indices(category, split))
            seen = self._catalogue(category, split)
        else:
            total, seen = None, asset_views(assets, category, self._setting, self._views)
        with output.Progress(f"views of {category}") as progress:
            done = 0

            def show(name: str) -> None:
                nonlocal done
                done += 1
                progress.update(done, total, name)

            return predict_views(self._service, seen, give_cad=self._give_cad, progress=show)

    def _catalogue(self, category: str, split: Split) -> Iterator[SeenObject]:
        for index in split_indices(category, split):
            yield from catalogue_views(category, index, self._setting, self._views)
