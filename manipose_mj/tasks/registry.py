"""Named tasks: factories with tags, looked up by domain and task name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from manipose_mj.errors import unknown_name
from manipose_mj.tasks.base import ManipulationTask
from manipose_mj.tasks.options import TaskOptions


class TaskFactory(Protocol):
    """Builds a task from what its users may choose."""

    def __call__(self, options: TaskOptions) -> ManipulationTask: ...


@dataclass(frozen=True)
class TaskSpec:
    """One registered task: its names, its factory, tags, and one line on what it asks for."""

    domain: str
    name: str
    factory: TaskFactory
    tags: tuple[str, ...]
    summary: str

    @property
    def full_name(self) -> str:
        """`domain/name`."""
        return f"{self.domain}/{self.name}"


_TASKS: dict[tuple[str, str], TaskSpec] = {}


def register_task(
    domain: str, name: str, *, tags: tuple[str, ...] = ()
) -> Callable[[TaskFactory], TaskFactory]:
    """Register the decorated factory as `domain/name`; its docstring's first line is the summary.

    Raises:
      ValueError: The name is taken, or the factory has no docstring.
    """

    def decorate(factory: TaskFactory) -> TaskFactory:
        if (domain, name) in _TASKS:
            raise ValueError(f"task {domain}/{name} is registered already")
        if not factory.__doc__:
            raise ValueError(f"the factory of {domain}/{name} needs a docstring")
        summary = factory.__doc__.strip().splitlines()[0]
        _TASKS[domain, name] = TaskSpec(domain, name, factory, tags, summary)
        return factory

    return decorate


def all_tasks() -> tuple[tuple[str, str], ...]:
    """Every registered `(domain, name)`, in the order of registration."""
    return tuple(_TASKS)


def task_spec(domain: str, name: str) -> TaskSpec:
    """The registered task.

    Raises:
      InputError: There is none; the nearest names are offered.
    """
    if (domain, name) not in _TASKS:
        raise unknown_name("task", f"{domain}/{name}", (s.full_name for s in _TASKS.values()))
    return _TASKS[domain, name]
