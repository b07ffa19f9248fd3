"""Drawn starts that a file keeps, for benchmarks that are run again or elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from manipose_mj.batch.drawing import draw_pool
from manipose_mj.batch.starts import StartPool
from manipose_mj.tasks.core.config import EnvConfig


def kept_starts(path: Path | None, config: EnvConfig, seeds: Sequence[int]) -> StartPool:
    """The starts in a file, if it is there; otherwise drawn of these seeds, and written to it.

    Args:
      path: Of the file; None: they are kept nowhere.
      config: Of the task, where they are drawn.
      seeds: Likewise.
    """
    if path is not None and path.exists():
        return StartPool.load(path)
    pool = draw_pool(config, seeds)
    if path is not None:
        pool.save(path)
    return pool
