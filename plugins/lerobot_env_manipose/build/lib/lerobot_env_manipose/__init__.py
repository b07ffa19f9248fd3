"""The tasks of ManiPose-MJ in LeRobot: `lerobot-eval --env.type=manipose --env.task=single_object/target_pose`."""

from lerobot_env_manipose.configuration import ManiPoseEnvConfig
from lerobot_env_manipose.environment import LeRobotEnv

__all__ = ["LeRobotEnv", "ManiPoseEnvConfig"]
