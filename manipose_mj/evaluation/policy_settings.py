"""How an evaluation asks somebody's policy for actions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from manipose_mj.control.perception.source_names import MASK_SOURCES, POSE_SOURCES
from manipose_mj.errors import InputError, unknown_name
from manipose_mj.evaluation.command_words import number_word
from manipose_mj.tasks.observations.ground_truth import told_by_all
from manipose_mj.wire.address import shown

Stop = Literal["success", "horizon"]
STOPS: tuple[Stop, ...] = ("success", "horizon")
ObsFormat = Literal["manipose", "droid"]
OBS_FORMATS: tuple[ObsFormat, ...] = ("manipose", "droid")
CONTROL_HZ = 50.0


@dataclass(frozen=True)
class Attachment:
    """A policy that was given the simulator, by its method `attach`, and what it says that it takes from there.

    Attributes: pose_source: of `POSE_SOURCES`; mask_source: of `MASK_SOURCES`.
    """

    pose_source: str = "oracle"
    mask_source: str = "oracle"


@dataclass(frozen=True)
class PolicySettings:
    """A policy, what it sees, and how its actions are carried out.

    Attributes:
      name: `package.module:Factory` or `ws://host:port`.
      arguments: Keyword arguments of the factory, a JSON object.
      obs_mode: What it sees, modes and keys joined by `+`; by default `state`, and `state+rgb` in DROID's format.
      control_mode: What its actions mean.
      hz: Its actions per second of simulated time; targets are held in between.
      execute: Of each answer's actions, how many are carried out; None: all. Of an answer that says `done`, all are.
      obs_format: Names of observations, and the sign of the gripper's command.
      stop: `"success"`: an episode ends once the goal has held for half a second; `"horizon"`: at its time limit.
      attachment: What a policy that is given the simulator takes from there; None where it is not given. An
        evaluation sets it once it has made the policy.

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
    attachment: Attachment | None = None

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
        parts = set(self.obs_mode.split("+"))
        if self.obs_format == "droid" and parts != {"state", "rgb"}:
            what = "has more than" if {"state", "rgb"} < parts else "lacks"
            raise InputError(
                f"observation mode {self.obs_mode!r} {what} what DROID's format is made of; "
                "add --obs-mode state+rgb"
            )

    @property
    def pose_source(self) -> str:
        """Where it takes object poses from: a pose source of the baseline's, or `"none"`."""
        if told_by_all(self.obs_mode).poses:
            return "oracle"
        return "none" if self.attachment is None else self.attachment.pose_source

    @property
    def mask_source(self) -> str:
        """Where it takes instance masks from: `"oracle"`, the simulator, or `"none"`."""
        if told_by_all(self.obs_mode).masks:
            return "oracle"
        return "none" if self.attachment is None else self.attachment.mask_source

    @property
    def identity(self) -> dict[str, Any]:
        """What two runs must share for their results to belong together; JSON, without the secrets of an address."""
        given = {**vars(self), "name": shown(self.name)}
        attachment = given.pop("attachment")
        # Runs of policies that are not given the simulator say nothing of it, nor did they ever.
        return given if attachment is None else {**given, "attachment": dict(vars(attachment))}

    @property
    def words(self) -> list[str]:
        """The options of the command line that say the same, but for a user, password or query in an address."""
        words = ["--policy", shown(self.name)]
        if self.arguments is not None:
            words += ["--policy-args", self.arguments]
        words += ["--obs-mode", self.obs_mode, "--control-mode", self.control_mode]
        words += ["--hz", number_word(self.hz)]
        if self.execute is not None:
            words += ["--execute", str(self.execute)]
        return [*words, "--obs-format", self.obs_format, "--stop", self.stop]


def settings_of(identity: Mapping[str, Any]) -> PolicySettings:
    """The settings of an `identity`, such as a run's record holds.

    Raises:
      InputError: It is none.
    """
    try:
        attachment = identity.get("attachment")
        given = None if attachment is None else Attachment(**attachment)
        return PolicySettings(**{**identity, "attachment": given})
    except (AttributeError, TypeError) as error:
        raise InputError(f"no settings of a policy ({error})") from None


def attachment_of(policy: object) -> Attachment | None:
    """What a policy takes from the simulator; None for one that does not ask for it.

    Its attributes `pose_source` and `mask_source` say so. Where they are missing or no known name, all is true.

    Args:
      policy: Anybody's.
    """
    if not callable(getattr(policy, "attach", None)):
        return None
    poses, masks = getattr(policy, "pose_source", None), getattr(policy, "mask_source", None)
    return Attachment(
        poses if isinstance(poses, str) and poses in POSE_SOURCES else "oracle",
        masks if isinstance(masks, str) and masks in MASK_SOURCES else "oracle",
    )
