"""`manipose pose export`: views of catalogue objects as a BOP data set."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from manipose_mj.cli.pose.train import Name
from manipose_mj.console.process import CORES, prepare_workers
from manipose_mj.errors import InputError


def export_views(
    name: Name,
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    setting: str = "tasks",
    split: Literal["train", "test"] = "test",
    views: int = 32,
    jobs: int = CORES,
) -> int:
    """Write views of the catalogue's objects as a data set in the layout of the BOP benchmark.

    A model's frame is the frame of its pose label: origin and axes of manipose's labels, not BOP's usual z up. Files
    are in millimetres. The views are those that `manipose pose evaluate` shows an estimator.

    Args:
      name: A category, such as mug; or a type, axial, mirror or functional.
      out: New folder for the data set.
      setting: From where objects are seen: anywhere, resting, tasks, clean, occluded.
      split: Of the catalogue.
      views: Of each object.
      jobs: Processes that render.
    """
    prepare_workers(jobs)
    if views < 1:
        raise InputError(f"--views is {views}; expected at least 1")
    from manipose_mj.bop.export import export
    from manipose_mj.console import output
    from manipose_mj.ppf_jax.data.view_settings import view_setting
    from manipose_mj.ppf_jax.evaluation.pose_predictions import categories_of

    categories, chosen = categories_of(name), view_setting(setting)
    with output.Progress("objects") as progress:
        images = export(
            categories, out, chosen, views=views, split=split, jobs=jobs, progress=progress.update
        )
    output.standard_output().print(f"{images} images: {out}", soft_wrap=True)
    return 0
