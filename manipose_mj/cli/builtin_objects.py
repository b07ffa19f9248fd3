"""Built-in objects, built with progress where this machine has not built them yet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from manipose_mj.assets.asset import Asset


def load_objects(names: Sequence[str], jobs: int) -> list[Asset]:
    """The built-in objects of these names, in the order of the names.

    Args:
      names: Such as `"mug_003"`.
      jobs: How many to build at the same time.

    Raises:
      InputError: There is none of a name, or the cache cannot be written.
    """
    import joblib
    from joblib.externals.loky import get_reusable_executor

    from manipose_mj.assets import catalogue
    from manipose_mj.console import output

    missing = [name for name in names if not catalogue.is_built(*catalogue.find(name))]
    if missing:
        with output.Progress("built-in objects") as progress:
            pool = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
            calls = (joblib.delayed(catalogue.load_by_name)(name) for name in missing)
            for done, asset in enumerate(pool(calls), start=1):
                progress.update(done, len(missing), f"{asset.name} is built")
        # What comes next starts in workers without what building has left in their memory.
        get_reusable_executor().shutdown()
    return [catalogue.load_by_name(name) for name in names]


def names_in_protocol(version: str, tasks: Sequence[str], episodes: int) -> list[str]:
    """Of the built-in objects that the first episodes of a protocol use.

    Args:
      version: Of the protocol.
      tasks: `"domain/task"` names.
      episodes: Number per task.
    """
    from manipose_mj.evaluation import protocol

    frozen = protocol.load(version)
    used = (frozen.episode(task, i).objects for task in tasks for i in range(episodes))
    return sorted({name for each in used for name in each} - set(frozen.sources))
