"""Gymnasium environments over the same tasks; importing this registers them.

    import gymnasium
    import manipose_mj.gym

    env = gymnasium.make("manipose_mj/StoreChipsCanMiddleDrawer-v0", obs_mode="state+pose")

`gymnasium.make("manipose_mj.gym:manipose_mj/StoreChipsCanMiddleDrawer-v0")` needs no import of ours: Gymnasium
1 looks for no plug-ins. Tasks that anybody registers with `manipose_mj.register_task` get their id too.
"""

from manipose_mj import suite  # noqa: F401  (registers the tasks)
from manipose_mj.gym.env import ManiPoseEnv
from manipose_mj.gym.registration import env_id, register_envs

__all__ = ["ManiPoseEnv", "env_id", "register_envs"]

register_envs()
