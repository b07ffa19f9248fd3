"""Evaluation protocols, frozen so that two papers can compare.

from manipose_mj import protocol, suite

task = protocol.load("v1").task("single_object/target_pose")
env = suite.load("single_object", "target_pose", split="test")
for name, seed in task.seeds.items():
    env.random_state.seed(seed)
    timestep = env.reset()
"""

from manipose_mj.evaluation.protocol.frozen import VERSIONS, FrozenTask, Protocol, load

__all__ = ["VERSIONS", "FrozenTask", "Protocol", "load"]
