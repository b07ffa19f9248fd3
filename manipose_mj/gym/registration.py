"""Gymnasium ids: one a registered task, of now and of later."""

from __future__ import annotations

import gymnasium

from manipose_mj.tasks.core.registry import TaskSpec, on_registration

NAMESPACE = "manipose_mj"


def env_id(name: str) -> str:
    """`manipose_mj/StoreChipsCanMiddleDrawer-v0` for `articulated/store_chips_can_middle_drawer`.

    Args:
      name: Of a task, with or without its domain.
    """
    words = name.rpartition("/")[2].split("_")
    return f"{NAMESPACE}/{''.join(word[:1].upper() + word[1:] for word in words)}-v0"


def register_envs() -> None:
    """Register every task with Gymnasium, and those registered later; again changes nothing."""
    on_registration(_register)


def _register(spec: TaskSpec) -> None:
    identifier = env_id(spec.name)
    if identifier in gymnasium.registry:
        taken = gymnasium.registry[identifier].kwargs.get("task")
        raise ValueError(
            f"task {spec.full_name} would have the Gymnasium id {identifier}, which is {taken}'s; "
            "choose another name"
        )
    # Entry points as text: making or listing environments loads no more than it must.
    gymnasium.register(
        identifier,
        entry_point="manipose_mj.gym.env:ManiPoseEnv",
        vector_entry_point="manipose_mj.gym.vector:make_vector",
        kwargs={"task": spec.full_name},
    )
