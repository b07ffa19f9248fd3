"""Gymnasium ids: one a registered task, of now and of later."""

from __future__ import annotations

import gymnasium

from manipose_mj.tasks.core.registry import TaskSpec, env_id, on_registration


def register_envs() -> None:
    """Register every task with Gymnasium, and those registered later; again changes nothing."""
    on_registration(_ENVS)


class _Envs:
    """Gymnasium's registry."""

    def check(self, spec: TaskSpec) -> None:
        identifier = env_id(spec.name)
        if identifier in gymnasium.registry:
            raise ValueError(f"task {spec.full_name}: Gymnasium knows an id {identifier} already")

    def add(self, spec: TaskSpec) -> None:
        # Entry points as text: making or listing environments loads no more than it must.
        gymnasium.register(
            env_id(spec.name),
            entry_point="manipose_mj.gym.env:ManiPoseEnv",
            vector_entry_point="manipose_mj.gym.vector:make_vector",
            kwargs={"task": spec.full_name},
        )


_ENVS = _Envs()
