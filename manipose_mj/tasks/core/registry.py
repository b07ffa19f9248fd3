"""Named tasks: factories with tags, looked up by domain and task name."""

from __future__ import annotations

import fnmatch
import importlib
import inspect
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from manipose_mj.errors import InputError, brief, unknown_name
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.scene_objects import ObjectDrawFactory, SceneObjects
from manipose_mj.tasks.core.task import ManipulationTask


class TaskFactory(Protocol):
    """Builds a task from what its user chose, with the same objects for all episodes."""

    def __call__(self, env_config: EnvConfig) -> ManipulationTask: ...


class DrawnTaskFactory(Protocol):
    """Builds a task from what its user chose and the objects that were drawn for an episode."""

    def __call__(self, env_config: EnvConfig, objects: SceneObjects) -> ManipulationTask: ...


Factory = TaskFactory | DrawnTaskFactory


@dataclass(frozen=True)
class TaskSpec:
    """One registered task: its names, its factory, tags, and one line on what it asks for.

    Attributes:
      draws: Makes the draw of an episode's objects; None where all episodes have the same.
      rigid: Whether there are rigid objects in its scenes, beside furniture.
    """

    domain: str
    name: str
    factory: Factory
    tags: tuple[str, ...]
    summary: str
    draws: ObjectDrawFactory | None = None
    rigid: bool = True

    @property
    def full_name(self) -> str:
        """`domain/name`."""
        return f"{self.domain}/{self.name}"

    @property
    def description(self) -> str:
        """What the factory's docstring says after its first line, for the task's card; may be empty."""
        _, _, rest = inspect.cleandoc(self.factory.__doc__ or "").partition("\n")
        return rest.strip()

    def __reduce__(self) -> tuple[Any, ...]:
        # By name, for factories that are closures; a worker's process must register the task first.
        return _registered, (self.factory.__module__, self.domain, self.name)


def _registered(module: str, domain: str, name: str) -> TaskSpec:
    importlib.import_module(module)
    return task_spec(domain, name)


class Listener(Protocol):
    """A front door that keeps tasks in a list of its own."""

    def check(self, spec: TaskSpec) -> None:
        """Raise ValueError for a task that it cannot take; changes nothing."""
        ...

    def add(self, spec: TaskSpec) -> None:
        """Take a task."""
        ...


GYM_NAMESPACE = "manipose_mj"
_WORDS = re.compile(r"[a-z0-9]+(_[a-z0-9]+)*")
_TASKS: dict[tuple[str, str], TaskSpec] = {}
_listeners: list[Listener] = []


FactoryT = TypeVar("FactoryT", bound=Factory)


def register_task(
    domain: str,
    name: str,
    *,
    tags: Sequence[str] = (),
    draws: ObjectDrawFactory | None = None,
    rigid: bool = True,
) -> Callable[[FactoryT], FactoryT]:
    """Register the decorated factory as `domain/name`: for this package's tasks and for anybody's.

    Every front door then knows the task: `suite.load` and `suite.ALL_TASKS`; `dm_control.suite` after
    `register_suite()`; Gymnasium after `import manipose_mj.gym`; and the command line, in a process
    that imports the module of the factory.

    Args:
      domain: The family: lower case words joined by `_`.
      name: Likewise; the Gymnasium id is made of it alone.
      tags: For `dm_control.suite`'s subsets.
      draws: Where the objects differ from episode to episode: makes, for an environment, what draws them.
        The factory then takes those that were drawn as a second argument, `objects`.
      rigid: False where no scene has a rigid object: evaluations then refuse errors of objects' poses.

    The first line of the factory's docstring is the summary that `manipose list` shows; the rest goes
    to the task's card.

    Raises:
      ValueError: The name is none or taken, here or at a front door, tags are no words, `draws` cannot be called, or the
        factory has no docstring; nothing is registered then.
    """

    def decorate(factory: FactoryT) -> FactoryT:
        _check_name(domain, name)
        task = f"task {domain}/{name}"
        words = isinstance(tags, tuple | list) and all(isinstance(tag, str) for tag in tags)
        if not words:
            raise ValueError(f"{task}: tags is {brief(tags)}; expected a tuple of words")
        if draws is not None and not callable(draws):
            raise ValueError(f"{task}: draws is {brief(draws)}; expected a function")
        if not factory.__doc__:
            raise ValueError(f"the factory of {domain}/{name} needs a docstring")
        summary = factory.__doc__.strip().splitlines()[0]
        spec = TaskSpec(domain, name, factory, tuple(tags), summary, draws, rigid)
        for listener in _listeners:
            listener.check(spec)
        for listener in _listeners:
            listener.add(spec)
        _TASKS[domain, name] = spec
        return factory

    return decorate


def env_id(name: str) -> str:
    """`manipose_mj/StoreChipsCanMiddleDrawer-v0`, the Gymnasium id of `articulated/store_chips_can_middle_drawer`.

    Args:
      name: Of a task, with or without its domain.
    """
    words = name.rpartition("/")[2].split("_")
    return f"{GYM_NAMESPACE}/{''.join(word[:1].upper() + word[1:] for word in words)}-v0"


def _check_name(domain: str, name: str) -> None:
    """Raise `ValueError` for a task that no front door could tell from the others."""
    for what, word in (("domain", domain), ("name", name)):
        if not isinstance(word, str) or not _WORDS.fullmatch(word):
            raise ValueError(
                f"task {domain}/{name}: the {what} is {word!r}; expected lower case words joined by _"
            )
    if (domain, name) in _TASKS:
        raise ValueError(f"task {domain}/{name} is registered already")
    for known in _TASKS.values():
        if env_id(known.name) == env_id(name):
            raise ValueError(
                f"task {domain}/{name} would have the Gymnasium id {env_id(name)}, which is {known.full_name}'s; "
                "choose another name"
            )


def on_registration(listener: Listener) -> None:
    """Tell the listener of every task that is registered, and of each that will be; once only.

    Raises:
      ValueError: It cannot take one of them; it is told of none then.
    """
    if listener not in _listeners:
        for spec in _TASKS.values():
            listener.check(spec)
        for spec in _TASKS.values():
            listener.add(spec)
        _listeners.append(listener)


def all_tasks() -> tuple[tuple[str, str], ...]:
    """Every registered `(domain, name)`, in the order of registration."""
    return tuple(_TASKS)


def tasks_named(patterns: Iterable[str], names: Iterable[str] | None = None) -> tuple[str, ...]:
    """The full names of tasks, each once, in the order of the patterns.

    Args:
      patterns: Full names, or patterns of them with `*`, `?` and `[...]` as of `fnmatch`.
      names: To choose from; by default those of all registered tasks.

    Raises:
      InputError: There is no task of a name, or a pattern fits none.
    """
    known = ["/".join(task) for task in all_tasks()] if names is None else list(names)
    found: dict[str, None] = {}
    for pattern in patterns:
        fitting = fnmatch.filter(known, pattern)
        if not fitting and set(pattern) & set("*?["):
            raise InputError(f"no task fits {pattern!r}; `manipose list` names them")
        if not fitting:
            raise unknown_name("task", pattern, known)
        found.update(dict.fromkeys(fitting))
    return tuple(found)


def named_task(full_name: str) -> TaskSpec:
    """The registered task of a name such as `"single_object/target_pose"`.

    Raises:
      InputError: There is none; the nearest names are offered.
    """
    if not isinstance(full_name, str):
        raise InputError(f'task is {brief(full_name)}; expected "domain/name"')
    domain, slash, name = full_name.partition("/")
    if not slash:
        raise unknown_name("task", full_name, ("/".join(task) for task in _TASKS))
    return task_spec(domain, name)


def task_spec(domain: str, name: str) -> TaskSpec:
    """The registered task.

    Raises:
      InputError: There is none; the nearest names are offered.
    """
    if (domain, name) not in _TASKS:
        raise unknown_name("task", f"{domain}/{name}", (s.full_name for s in _TASKS.values()))
    return _TASKS[domain, name]
