"""Estimators of nobody, for tests: the module is named on the command line, so it imports nothing of ours."""

from __future__ import annotations

import sys

import numpy as np


class Middle:
    """Puts the label into the middle of what is seen, and remembers what it got."""

    def __init__(self, score: float = 0.2) -> None:
        self.score = score
        self.seen: list[dict] = []

    def estimate(self, observation):
        self.seen.append(observation)
        sys.stdout.write("the middle of the points\n")  # no business of tables and JSON
        pose = np.eye(4)
        pose[:3, 3] = np.median(observation["cloud"], axis=0)
        return {"pose": pose, "score": self.score}


class Says:
    """Answers what it is told to."""

    def __init__(self, answer=None) -> None:
        self.answer = answer

    def estimate(self, observation):
        return self.answer


class Raises:
    """Fails on every object."""

    def estimate(self, observation):
        raise KeyError("no\nsuch category")


class Leaves:
    """Ends the program when it is asked."""

    def estimate(self, observation):
        sys.exit(3)


def leaving():
    """Ends the program instead of making one."""
    sys.exit(0)


def without_estimate():
    """Makes something else."""
    return object()


def failing():
    """Cannot be made."""
    raise RuntimeError("no GPU")


not_callable = 3
