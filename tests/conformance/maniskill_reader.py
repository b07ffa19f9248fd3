"""Run by ManiSkill's Python: opens FILE with its class for trajectories, and prints what a learner would get of it.

Usage: maniskill_reader.py FILE
"""

import json
import sys

import torch
from mani_skill.trajectory.dataset import ManiSkillTrajectoryDataset


def shapes(value, name=""):
    """Shape and type of every tensor, by its path."""
    if isinstance(value, dict):
        found = {}
        for key, each in value.items():
            found |= shapes(each, f"{name}/{key}" if name else key)
        return found
    return {name: [list(value.shape), str(value.dtype)]}


data = ManiSkillTrajectoryDataset(sys.argv[1], success_only=True, device=torch.device("cpu"))
batch = next(iter(torch.utils.data.DataLoader(data, batch_size=8)))
said = {
    "frames": len(data),
    "env_id": data.env_id,
    "actions": data.actions.double().sum(dim=0).tolist(),
    "observations": shapes(batch["obs"]),
    "batch": shapes({name: each for name, each in batch.items() if name != "obs"}),
}
sys.stdout.write(json.dumps(said) + "\n")
