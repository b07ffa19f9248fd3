"""`manipose train`: learners on batched worlds."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.command_line import CommandApp
from manipose_mj.console.process import CORES, compile_at_once_on_gpus, prepare_workers
from manipose_mj.errors import InputError


def build_app() -> CommandApp:
    """The commands under `manipose train`."""
    app = CommandApp()
    app.add("ppo", train_ppo)
    return app


def train_ppo(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    worlds: int = 1024,
    starts: int = 512,
    seed: int = 0,
    minutes: float = 8.0,
    updates: Annotated[int | None, arg(help_behavior_hint="")] = None,
    until: Annotated[float | None, arg(metavar="SHARE", help_behavior_hint="")] = None,
    episode: Annotated[float, arg(metavar="SECONDS")] = 12.0,
    engine: Literal["auto", "c", "warp"] = "auto",
    jobs: int = CORES,
    objects: Annotated[
        tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...", help_behavior_hint="")
    ] = (),
    pool: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
    policy: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None,
) -> int:
    """Learn to open or shut a drawer or door, or to move an object, by proximal policy optimisation.

    Writes policy.npz, which evaluate plays, and curve.json.

    Args:
      task: One of articulated/open_* and close_*, or one about an object and no furniture, also in clutter or of your own.
      out: Folder to write to; without it ppo/NAME.
      worlds: At the same time.
      starts: Episodes that the worlds begin with, drawn once.
      seed: Of the networks and of what they try.
      minutes: That the updates may take, compiling included.
      updates: At most.
      until: Stop once this share of the episodes succeed, with the noise of exploration.
      episode: Length of an episode in training.
      engine: warp, on a GPU; c, on the CPU, far slower; auto, the former where it runs.
      jobs: Threads of the engine c; what is learnt does not depend on them.
      objects: Instead of the built-in ones for training: names, asset folders, or folders of them.
      pool: File with the starts: read if it is there, otherwise written.
      policy: The policy.npz of a training, from which this one goes on.
    """
    prepare_workers(jobs)
    compile_at_once_on_gpus()
    numbers = {"worlds": worlds, "starts": starts, "minutes": minutes, "updates": updates}
    for name, value in numbers.items():
        if value is not None and not value > 0:
            raise InputError(f"--{name} is {value}; expected more than 0")
    if not 0 < episode < float("inf"):
        raise InputError(f"--episode is {episode}; expected a finite time, more than 0")
    if until is not None and not 0 < until <= 1:
        raise InputError(f"--until is {until}; expected a share, more than 0 and at most 1")
    from manipose_mj.batch.making import available_engine
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.console import output
    from manipose_mj.learning.trained import Trained
    from manipose_mj.learning.training import (
        POLICY_FILE,
        TrainingConfig,
        check_folder,
        train,
        training_pool,
    )

    check_names((task,), objects)
    config = TrainingConfig(
        task,
        worlds=worlds,
        starts=starts,
        seed=seed,
        minutes=minutes,
        updates=updates,
        until=until,
        episode=episode,
        engine=available_engine(engine),
        threads=jobs,
        objects=objects or None,
        policy=policy,
    )
    out = out or Path("ppo") / task.rpartition("/")[2]
    check_folder(out, policy)
    if policy is not None:
        Trained.load(policy)  # drawing starts takes minutes
    kept = pool is not None and pool.exists()
    with output.Progress("starts") as progress, _told_what_is_kept(out, pool):

        def counted(done: int, total: int) -> None:
            progress.update(done, total, "drawn")

        drawn = training_pool(config, pool, counted)
    console = output.standard_error()
    if kept:
        about = sorted({start.object_name for start in drawn.starts})
        console.print(
            f"{pool}: {len(drawn.starts)} starts about {', '.join(about)}; --starts and --objects are of new ones",
            soft_wrap=True,
        )

    if drawn.layout.goal_frames:
        console.print(
            f"{task}: the policy does not see where the object shall go; it can learn what all goals share",
            soft_wrap=True,
        )

    def show(row: dict[str, float]) -> None:
        console.print(
            f"{row['seconds']:5.0f} s, {row['actions'] / 1e6:6.2f} M actions: {row['succeeded']:4.0%} of "
            f"{row['ended']:.0f} episodes succeeded, reward {row['reward']:.3f}, spread {row['spread']:.2f}, "
            f"overflowed {row['overflowed']:.1%}, diverged {row['diverged']:.0f}"
        )

    with _told_what_is_kept(out, pool):
        train(config, drawn, out, show)
    output.standard_output().print(f"policy: {out / POLICY_FILE}", soft_wrap=True)
    return 0


@contextmanager
def _told_what_is_kept(out: Path, pool: Path | None) -> Iterator[None]:
    """Inside, an interruption of the training says which of its files are there."""
    from manipose_mj.learning.training import POLICY_FILE

    try:
        yield
    except KeyboardInterrupt:
        files = [each for each in (out / POLICY_FILE, pool) if each is not None and each.exists()]
        kept = " and ".join(map(str, files))
        raise KeyboardInterrupt(f"kept: {kept}" if kept else "nothing was written yet") from None
