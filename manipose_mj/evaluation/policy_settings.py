"""How an evaluation asks somebody's policy for actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from manipose_mj.errors import InputError, unknown_name

Stop = Literal["success", "horizon"]
STOPS: tuple[Stop, ...] = ("success", "horizon")
ObsFormat = Literal["manipose", "droid"]
OBS_FORMATS: tuple[ObsFormat, ...] = ("manipose", "droid")
CONTROL_HZ = 50.0
# Modes that tell what no sensor of a real robot does.
_TRUE_POSES = ("pose", "segmentation")


@dataclass(frozen=True)
class PolicySettings:
    """A policy, what it sees, and how its actions are carried out.

    Attributes:
      name: `package.module:Factory` or `ws://host:port`.
      arguments: Keyword arguments of the factory, a JSON object.
      obs_mode: What it sees, modes and keys joined by `+`; by default `state`, and `state+rgb` in DROID's format.
      control_mode: What its actions mean.
      hz: Its actions per second of simulated time; targets are held in between.
      execute: Of each answer's actions, how many are carried out; None: all.
      obs_format: Names of observations, and the sign of the gripper's command.
      stop: `"success"`: an episode ends once the goal has held for half a second; `"horizon"`: at its time limit.

    Raises:
      InputError: A value that cannot be.
    """

    name: str
    arguments: str | None = None
    obs_mode: str = ""
    control_mode: str = "pd_joint_pos"
    hz: float = 10.0
    execute: int | None = None
    obs_format: ObsFormat = "manipose"
    stop: Stop = "success"

    def __post_init__(self) -> None:
        if not self.obs_mode:
            default = "state+rgb" if self.obs_format == "droid" else "state"
            object.__setattr__(self, "obs_mode", default)
        if not 0 < self.hz <= CONTROL_HZ:
            raise InputError(f"hz is {self.hz:g}; expected more than 0 and at most {CONTROL_HZ:g}")
        if self.execute is not None and self.execute < 1:
            raise InputError(f"execute is {self.execute}; expected at least 1")
        if self.control_mode == "primitive":
            raise InputError(
                "control mode 'primitive' has no rate: its actions are whole motions; choose another"
            )
        for what, value, known in (
            ("observation format", self.obs_format, OBS_FORMATS),
            ("stop", self.stop, STOPS),
        ):
            if value not in known:
                raise unknown_name(what, value, known)
        parts = self.obs_mode.split("+")
        if self.obs_format == "droid" and not {"state", "rgb"} <= set(parts):
            raise InputError(
                f"observation mode {self.obs_mode!r} lacks what DROID's format is made of; "
                "add --obs-mode state+rgb"
            )

    @property
    def sees_true_poses(self) -> bool:
        """Whether its observations tell what only a simulator knows."""
        return tells_true_poses(self.obs_mode)

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together; JSON."""
        return dict(vars(self))

    @property
    def words(self) -> list[str]:
        """The options of the command line that say the same."""
        words = ["--policy", self.name]
        if self.arguments is not None:
            words += ["--policy-args", self.arguments]
        words += ["--obs-mode", self.obs_mode, "--control-mode", self.control_mode]
        words += ["--hz", f"{self.hz:g}"]
        if self.execute is not None:
            words += ["--execute", str(self.execute)]
        return [*words, "--obs-format", self.obs_format, "--stop", self.stop]


def tells_true_poses(obs_mode: str) -> bool:
    """Whether observations of a mode tell what only a simulator knows: poses, or which pixel is which object."""
    return any(
        part.split("/")[0] in _TRUE_POSES or part.startswith("pointcloud/")
        for part in obs_mode.split("+")
    )
