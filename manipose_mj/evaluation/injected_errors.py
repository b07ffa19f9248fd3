"""Errors that an evaluation makes on purpose, to measure what each of them costs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from manipose_mj.errors import InputError
from manipose_mj.evaluation.command_words import number_word

if TYPE_CHECKING:
    from manipose_mj.control.perception.perturbed import PosePerturbation
    from manipose_mj.tasks.observations.sensor_config import SensorConfig


@dataclass(frozen=True)
class InjectedErrors:
    """Errors in the units of the command line; their directions follow from each episode's seed.

    Attributes:
      pose_error_cm: Every object's pose is off by this distance.
      pose_error_deg: Every object's pose is off by this angle.
      camera_error_cm: Every camera is off by this distance from where its calibration states it.
      camera_error_deg: Every camera is turned by this angle against its calibration.
      depth_noise: Noise of measured depth, as a multiple of a Kinect's; 0: none. By default 1 for the baseline,
        none for a policy.
      cameras: What perception looks through, by names: front, left, right, overview, panda/wrist. By default the
        baseline's or the policy's own.
      latency_ms: By how much servo targets come late.
      assume_upright: The baseline takes every object that it does not hold to stand upright, as one that knows
        no orientations would.
    """

    pose_error_cm: float = 0.0
    pose_error_deg: float = 0.0
    camera_error_cm: float = 0.0
    camera_error_deg: float = 0.0
    depth_noise: float | None = None
    cameras: tuple[str, ...] = ()
    latency_ms: float = 0.0
    assume_upright: bool = False

    def check(self) -> None:
        """Raises InputError where a number is negative or not finite."""
        # Not when it is made: the parser of the command line would tell that in a frame of its own.
        for name, value in vars(self).items():
            if isinstance(value, int | float) and not 0 <= value < math.inf:
                raise InputError(f"{_option(name)} is {value}; expected 0 or more")

    @property
    def identity(self) -> dict[str, Any] | None:
        """Those that are made, JSON; None without any."""
        defaults = InjectedErrors()
        made = {k: v for k, v in vars(self).items() if v != getattr(defaults, k)}
        if "cameras" in made:
            made["cameras"] = list(self.cameras)
        return made or None

    @property
    def words(self) -> list[str]:
        """The options of the command line that say the same."""
        words: list[str] = []
        for name, value in (self.identity or {}).items():
            if value is True:
                words.append(_option(name))
            elif isinstance(value, list):
                words += [_option(name), *value]
            else:
                words += [_option(name), number_word(value)]
        return words

    @property
    def of_poses(self) -> str:
        """What is wrong with objects' poses, for people; empty if nothing is."""
        sizes = [
            f"{size:g} {unit}"
            for size, unit in ((self.pose_error_cm, "cm"), (self.pose_error_deg, "deg"))
            if size
        ]
        told = [f"off by {' and '.join(sizes)}"] if sizes else []
        return ", ".join([*told, *(["taken to stand upright"] if self.assume_upright else [])])

    @property
    def of_objects(self) -> tuple[str, ...]:
        """The options given that concern objects' poses."""
        return self._given("pose_error_cm", "pose_error_deg", "assume_upright")

    @property
    def of_cameras(self) -> tuple[str, ...]:
        """The options given that concern cameras."""
        return self._given("camera_error_cm", "camera_error_deg", "depth_noise", "cameras")

    def _given(self, *names: str) -> tuple[str, ...]:
        return tuple(_option(name) for name in names if name in (self.identity or {}))

    @property
    def latency(self) -> float:
        """[s]."""
        return self.latency_ms / 1000

    def pose_errors(self) -> PosePerturbation:
        """Those of the poses that the baseline acts on."""
        # Loads the simulator, as below: workers only.
        from manipose_mj.control.perception.perturbed import PosePerturbation
        from manipose_mj.tasks.observations.fixed_error import FixedError

        error = FixedError(self.pose_error_cm / 100, math.radians(self.pose_error_deg))
        return PosePerturbation(error, self.assume_upright)

    def of_sensors(self, sensors: SensorConfig) -> SensorConfig:
        """Sensors with these errors: of observed poses, calibration, depth, and how many cameras there are."""
        from manipose_mj.mjcf.cameras.depth_noise import KINECT
        from manipose_mj.tasks.observations.fixed_error import FixedError

        changed = replace(
            sensors,
            pose_error=FixedError(self.pose_error_cm / 100, math.radians(self.pose_error_deg)),
            camera_error=FixedError(
                self.camera_error_cm / 100, math.radians(self.camera_error_deg)
            ),
        )
        if self.cameras:
            changed = replace(changed, cameras=self.cameras)
        if self.depth_noise == 0:
            changed = replace(changed, depth_model="ideal")
        elif self.depth_noise is not None:
            changed = replace(changed, depth_model=replace(KINECT, noise=self.depth_noise))
        return changed


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
