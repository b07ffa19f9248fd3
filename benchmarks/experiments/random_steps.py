"""2,000 random steps of every task: deepest contact, warnings, observations outside their specs.

python benchmarks/experiments/random_steps.py [--seeds 1] [--only clutter/pick]
"""

from __future__ import annotations

import sys
import time

import mujoco
import numpy as np
import tyro

from manipose_mj import suite

LIMIT = 0.005  # of contacts [m]


def main(steps: int = 2000, seeds: int = 1, hold: int = 1, only: tuple[str, ...] = ()) -> None:
    """Print a line per task and seed; exit with 1 if one does not hold.

    Args:
      steps: Control steps.
      seeds: How many runs of each task.
      hold: Control steps for which an action is kept: 25 lets the arm swing right across the table.
      only: Tasks to run; all by default.
    """
    print(f"{'task':45} seed  deepest contact [mm]  between  broken  wall [s]")
    held = True
    for domain, name in suite.ALL_TASKS:
        if only and f"{domain}/{name}" not in only:
            continue
        for seed in range(seeds):
            started = time.perf_counter()
            depth, between, broken = wander(domain, name, seed, steps, hold)
            held &= depth < LIMIT and not broken
            wall = time.perf_counter() - started
            reason = broken or "nothing"
            print(
                f"{domain + '/' + name:45} {seed:4}  {1000 * depth:.2f}  {between}  {reason}  {wall:.0f}"
            )
            sys.stdout.flush()
    raise SystemExit(0 if held else 1)


def wander(domain: str, name: str, seed: int, steps: int, hold: int) -> tuple[float, str, str]:
    """The deepest contact [m], between what, and what broke: nothing, or a line."""
    environment = suite.load(domain, name, seed=seed, obs_mode="state+pose")
    spec, specs = environment.action_spec(), environment.observation_spec()
    rng = np.random.default_rng(seed)
    deepest = [(0.0, "")]

    def note(physics, random_state) -> None:
        contact = physics.data.contact
        if len(contact.dist) and -contact.dist.min() > deepest[0][0]:
            pair = contact.geom[contact.dist.argmin()]
            model = physics.model.ptr
            names = [
                model.body(model.geom_bodyid[geom]).name or model.geom(geom).name for geom in pair
            ]
            deepest[0] = (-float(contact.dist.min()), " | ".join(sorted(names)))

    environment.add_extra_hook("after_substep", note)
    environment.reset()
    warned = ""
    for count in range(steps):
        if count % hold == 0:
            action = rng.uniform(spec.minimum, spec.maximum)
        step = environment.step(action)
        if environment.failure:
            return *deepest[0], environment.failure_reason
        for key, value in step.observation.items():
            try:
                specs[key].validate(value)
            except ValueError as error:
                return *deepest[0], f"{key}: {error}"
            if not np.isfinite(value).all():
                return *deepest[0], f"{key} is not finite"
        warnings = np.flatnonzero(environment.physics.data.warning.number)
        if len(warnings):
            warned = ", ".join(mujoco.mjtWarning(int(w)).name for w in warnings)
            return *deepest[0], warned
    return *deepest[0], warned


if __name__ == "__main__":
    tyro.cli(main)
