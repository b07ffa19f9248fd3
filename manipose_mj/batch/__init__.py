"""Many worlds of a task at once, with the task's own starts, goals, rewards, control modes and observations.

from manipose_mj import batch

worlds = batch.make("single_object/target_pose", worlds=64, engine="c")
state = worlds.reset(jax.random.key(0))
state = worlds.step(state, actions)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.batch.capacity import Capacity
    from manipose_mj.batch.making import from_pool, make
    from manipose_mj.batch.starts import StartPool
    from manipose_mj.batch.state import State, Transition
    from manipose_mj.batch.worlds import Worlds

__all__ = ["Capacity", "StartPool", "State", "Transition", "Worlds", "from_pool", "make"]

__getattr__ = lazy_exports(__name__, __file__)
