"""`manipose robustness`: recorded plans in many other worlds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from manipose_mj.console.process import (
    CORES,
    compile_at_once_on_gpus,
    prepare_workers,
)
from manipose_mj.errors import InputError

RESULTS = "robustness.json"


def robustness(
    task: Annotated[Positional[str], arg(metavar="TASK")],
    /,
    *,
    plan_from: Annotated[str, arg(metavar="seeds|DIR")] = "seeds",
    plans: int = 4,
    worlds: int = 64,
    engine: Literal["auto", "c", "warp"] = "auto",
    out: Annotated[Path | None, arg(metavar="DIR", help_behavior_hint="")] = None,
    seed: int = 0,
    friction: float = 1.5,
    pad_friction: float = 1.5,
    mass: float = 1.4,
    gains: float = 1.2,
    latency_ms: float = 40.0,
    shift_cm: float = 1.0,
    turn_deg: float = 5.0,
    object_shift_cm: float = 0.5,
    object_turn_deg: float = 2.0,
    objects: Annotated[
        tuple[str, ...], arg(aliases=("--object",), metavar="NAME|DIR...", help_behavior_hint="")
    ] = (),
    jobs: int = CORES,
) -> int:
    """Play recorded plans of the baseline open loop in worlds that differ from that they were made in, and map success.

    Writes robustness.json and robustness.png.

    Args:
      task: As manipose list names it.
      plan_from: seeds records plans of the baseline with true poses now; a folder of manipose demos record holds them.
      plans: How many.
      worlds: In all, equally many of each plan.
      engine: warp, on an NVIDIA GPU; c, on the CPU; auto, the former where it runs.
      out: Folder to write to; without it robustness/NAME.
      seed: Of the draws.
      friction: Factor by which friction differs at most, up or down, between what is not touched by the finger pads.
      pad_friction: The same for the finger pads, whatever they touch.
      mass: The same for objects' masses.
      gains: The same for the stiffness of each servo, the gripper's too.
      latency_ms: Most by which set-points come late.
      shift_cm: Most by which objects and furniture stand, as one, beside where the plan has them: a wrong calibration.
      turn_deg: Most by which they are turned about the first object; this carries what stands beside it farther than shift_cm.
      object_shift_cm: Most by which each object stands beside that: an error of its pose.
      object_turn_deg: Most by which each object is turned about the vertical.
      objects: What plans recorded now draw from: names of built-in objects, asset folders, or folders of them.
      jobs: Processes that record plans, and threads of the engine `c` that replay them.
    """
    prepare_workers(jobs)
    compile_at_once_on_gpus()
    from manipose_mj.batch.making import available_engine, require_worlds
    from manipose_mj.cli.evaluate import check_names
    from manipose_mj.console import output
    from manipose_mj.robustness.plans import recorded_plans
    from manipose_mj.robustness.replay import replays
    from manipose_mj.robustness.success_maps import document, draw
    from manipose_mj.robustness.variation import Variation
    from manipose_mj.storage.cache_file import new_cache_file
    from manipose_mj.tasks.core.config import check_seed

    check_names((task,), objects)
    require_worlds(worlds)
    check_seed(seed)
    if not 1 <= plans <= worlds:
        raise InputError(
            f"plans is {plans}; expected at least 1, and at most one a world: {worlds}"
        )
    out = out or Path("robustness") / task.rpartition("/")[2]
    if (out / RESULTS).exists():
        raise InputError(f"{out / RESULTS}: is there already; choose another --out")
    variation = Variation(
        friction,
        pad_friction,
        mass,
        gains,
        latency_ms,
        shift_cm,
        turn_deg,
        object_shift_cm,
        object_turn_deg,
    )
    chosen = available_engine(engine)
    with output.Progress("plans") as progress:

        def recorded(done: int, total: int) -> None:
            progress.update(done, total, "recorded")

        found = recorded_plans(
            task, plan_from, plans, objects=objects or None, jobs=jobs, on_progress=recorded
        )
    with output.Progress("worlds") as progress:

        def played(done: int, total: int) -> None:
            progress.update(done, total, "played")

        ended = replays(
            found,
            variation,
            worlds,
            seed=seed,
            engine=chosen,
            threads=jobs,
            on_progress=played,
        )
    said = document(task, variation, ended, engine=chosen, seed=seed)
    with new_cache_file(out / RESULTS) as scratch:
        scratch.write_text(json.dumps(said, indent=1))
    with new_cache_file(out / "robustness.png") as scratch:
        draw(said, scratch)
    console = output.standard_output()
    for name, what in (("as_planned", "as planned"), ("varied", "varied")):
        share = said[name]
        console.print(f"{what}: {share['successes']} of {share['worlds']} worlds succeeded")
    console.print(f"map: {out / 'robustness.png'}", soft_wrap=True)
    return 0
