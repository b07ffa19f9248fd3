"""Evaluation protocols, frozen so that two papers can compare.

from manipose_mj import protocol, suite
from manipose_mj.tasks import EpisodeSpec

task = protocol.load("v1").task("single_object/target_pose")
env = suite.load("single_object", "target_pose", split="test")
for name, episode in task.episodes.items():
    timestep = env.reset(EpisodeSpec(**episode.asked))
"""

from manipose_mj.evaluation.protocol.frozen import (
    VERSIONS,
    FrozenEpisode,
    FrozenTask,
    Protocol,
    load,
)

__all__ = ["VERSIONS", "FrozenEpisode", "FrozenTask", "Protocol", "load"]
