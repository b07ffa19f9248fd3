"""Built-in objects, built with progress where this machine has not built them yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from asset_pipeline.assets import Asset


def load_objects(names: Sequence[str], jobs: int) -> list[Asset]:
    """The built-in objects of these names, in the order of the names.

    Args:
      names: Such as `"mug_003"`.
      jobs: How many to build at the same time.

    Raises:
      InputError: There is none of a name, or the cache cannot be written.
    """
    import joblib

    from asset_pipeline import catalogue
    from manipose_mj.cli import output

    missing = [name for name in names if not catalogue.is_built(*catalogue.find(name))]
    if missing:
        with output.Progress("built-in objects") as progress:
            pool = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
            calls = (joblib.delayed(catalogue.load_by_name)(name) for name in missing)
            for done, asset in enumerate(pool(calls), start=1):
                progress.update(done, len(missing), f"{asset.name} is built")
    return [catalogue.load_by_name(name) for name in names]


def all_names() -> list[str]:
    """Of every built-in object."""
    from asset_pipeline import catalogue

    return [name for name, _ in catalogue.entries()]


def names_in_tasks() -> list[str]:
    """Of the built-in objects that the registered tasks put into their scenes."""
    from asset_pipeline.catalogue import CATALOGUE
    from manipose_mj.tasks.builtin import TARGET_POSE_OBJECTS

    drawn = (*TARGET_POSE_OBJECTS, ("cabinet", 0))
    return [CATALOGUE[category].instance(index) for category, index in drawn]
