"""Why an episode failed: the stage, and one line."""

from __future__ import annotations

STAGES = (
    "perception",
    "grasp",
    "plan",
    "motion",
    "release",
    "timeout",
    "physics",
    "policy",
    "error",
)


class StageFailure(Exception):
    """A policy gave up, or what it answered is no action.

    Attributes: stage: one of `STAGES`; reason: one line.
    """

    def __init__(self, stage: str, reason: str) -> None:
        assert stage in STAGES
        super().__init__(f"{stage}: {reason}")
        self.stage = stage
        self.reason = reason
