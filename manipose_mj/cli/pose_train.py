"""`manipose pose train`: an estimator for a category, or for all categories of a type."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.cli.process import CORES, one_thread_per_process
from manipose_mj.errors import InputError

WEIGHTS_FILE, CURVE_PICTURE = "weights.npz", "curve.png"
CHECKS = 4  # batches of test objects for the curve; nothing is chosen by them
Name = Annotated[Positional[str], arg(metavar="CATEGORY|TYPE")]


def train_pose(
    name: Name,
    /,
    *,
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    leave_out: Annotated[tuple[str, ...], arg(metavar="CATEGORY...")] = (),
    labels: Literal["unified", "original"] = "unified",
    setting: str = "training",
    views: int = 256,
    batch: int = 64,
    steps: int = 20_000,
    minutes: Annotated[float | None, arg(help_behavior_hint="")] = None,
    seed: int = 0,
    jobs: int = CORES,
) -> int:
    """Train a pose estimator on rendered views of the catalogue's training objects.

    Goes on where an interrupted training of the same folder was. Writes the weights, the state to go on
    from, and the curve as JSON and as a picture.

    Args:
      name: A category, such as mug; or a type, axial, mirror or functional: one network for all of
        its categories.
      out: Folder to write to; pose/NAME, or pose/NAME-original, without it.
      leave_out: Categories of the type that are not trained on.
      labels: The unified labels, or those of the sources that the objects are assigned to.
      setting: From where objects are seen: training, anywhere, resting, tasks, clean, occluded.
      views: Of each object.
      batch: Clouds in a step.
      steps: In all.
      minutes: Ends the training, cooled down, if the steps do not.
      seed: Of the first weights and of all that training draws.
      jobs: Processes that render.
    """
    one_thread_per_process()
    for option, value in (("--views", views), ("--batch", batch), ("--steps", steps)):
        if value < 1:
            raise InputError(f"{option} is {value}; expected at least 1")
    if minutes is not None and not minutes > 0:
        raise InputError(f"--minutes is {minutes:g}; expected more than 0")
    from manipose_mj.cli import output
    from manipose_mj.cli.pose_clouds import PoseClouds
    from manipose_mj.ppf_jax.curve_picture import draw_curve
    from manipose_mj.ppf_jax.model import ModelConfig
    from manipose_mj.ppf_jax.symmetry import common_symmetry
    from manipose_mj.ppf_jax.training import CURVE_FILE, Row, TrainingConfig, train
    from manipose_mj.ppf_jax.view_cache import batch_stream
    from manipose_mj.ppf_jax.weights import TrainedModel, save_weights

    source = PoseClouds(name, leave_out=leave_out, labels=labels, jobs=jobs)
    clouds = source.rendered("train", setting, views)
    held_out = source.rendered("test", setting, 1 + CHECKS * batch // source.objects("test"))
    checks = batch_stream(held_out, batch, seed)(0)
    suffix = "" if labels == "unified" else f"-{labels}"
    folder = Path("pose") / f"{name}{suffix}" if out is None else out
    with output.Progress("steps") as progress:

        def show(row: Row) -> None:
            error = f", {row['deg_median']:.1f} deg" if "deg_median" in row else ""
            progress.update(int(row["step"]) + 1, steps, f"loss {row['loss']:.3f}{error}")

        model = train(
            batch_stream(clouds, batch, seed),
            ModelConfig(symmetry=common_symmetry(cloud.symmetry for cloud in clouds)),
            TrainingConfig(steps=steps, seed=seed),
            folder,
            held_out=[next(checks) for _ in range(CHECKS)],
            minutes=minutes,
            progress=show,
        )
    save_weights(folder / WEIGHTS_FILE, TrainedModel(model, source.categories))
    draw_curve(folder / CURVE_FILE, folder / CURVE_PICTURE)
    output.standard_output().print(
        f"trained on {len(clouds)} views of {', '.join(source.categories)}; {folder / WEIGHTS_FILE}",
        soft_wrap=True,
    )
    return 0
