"""Small learners on batched worlds, and what they have learnt as policies.

    manipose train ppo articulated/open_middle_drawer --out drawer

| module | holds |
|---|---|
| `handle_frame.py`, `object_frame.py`, `frames.py` | what a policy sees and does, in the frame of a handle or object |
| `grip.py` | moving a hand about such a frame |
| `network.py` | actor and critic |
| `ppo.py` | proximal policy optimisation: rollout and update in one `scan` |
| `training.py` | a training from a task's name to a file |
| `trained.py` | the file, and the policy that `manipose evaluate` plays |
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from manipose_mj.lazy_exports import lazy_exports

if TYPE_CHECKING:
    from manipose_mj.learning.trained import TrainedPolicy

__all__ = ["TrainedPolicy"]

__getattr__ = lazy_exports(__name__, __file__)
