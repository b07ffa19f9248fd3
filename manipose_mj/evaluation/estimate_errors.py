"""How far off the poses were that a baseline acted on: the judge's knowledge, never the baseline's."""

from __future__ import annotations

import numpy as np
from dm_control import mjcf

from manipose_mj.control.baseline import Baseline
from manipose_mj.control.perception.estimated import EstimatedPerception
from manipose_mj.control.perception.perturbed import PerturbedPerception
from manipose_mj.control.perception.pose_sensing import EstimatedPose
from manipose_mj.failures import StageFailure
from manipose_mj.poses import pose_error
from manipose_mj.tasks.core.task import ManipulationTask


class EstimateErrors:
    """The largest errors of the estimates that objects were grasped with.

    Attributes:
      translation: Of the label's origin [m]; None where nothing estimated was grasped.
      rotation: The least over the object's symmetry [rad]; None likewise.
    """

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics, baseline: Baseline) -> None:
        self._task, self._physics, self._baseline = task, physics, baseline
        self.translation: float | None = None
        self.rotation: float | None = None
        self._seen: tuple[EstimatedPose, ...] = ()
        self._worst, self._worst_by = "", 0.0  # what is said of it; how many times the tolerance

    def after_planning(self) -> None:
        """Compare what the last plan was made with; the simulation has not gone on since."""
        perception = self._baseline.perception
        if (
            not isinstance(perception, EstimatedPerception | PerturbedPerception)
            or perception.last_estimates is self._seen
        ):
            return
        self._seen = perception.last_estimates
        primitive, _, name = self._baseline.status.partition(" ")
        for estimate in self._seen:
            if primitive == "grasp_at" and estimate.name == name:
                self._compare(estimate)

    def cause(self, failure: StageFailure) -> StageFailure:
        """The failure, or, where an estimate was beyond what counts as success, that of perception."""
        if self.translation is None or self.rotation is None:
            return failure
        tolerance = self._task.config.tolerance
        near = self.translation <= tolerance.translation and self.rotation <= tolerance.rotation
        if near or failure.stage in ("perception", "physics", "policy"):
            return failure
        return StageFailure("perception", f"{self._worst}; then {failure}")

    def _compare(self, estimate: EstimatedPose) -> None:
        obj = self._task.objects[estimate.name]
        truth = obj.label_pose(self._physics)
        errors = pose_error(estimate.pose, truth, obj.asset.label.symmetry)
        shift, turn = float(errors[0]), float(errors[1])
        tolerance = self._task.config.tolerance
        beyond = max(shift / tolerance.translation, turn / tolerance.rotation)
        if beyond > self._worst_by:
            self._worst_by = beyond
            self._worst = (
                f"{estimate.name} was grasped with an estimate {100 * shift:.1f} cm and "
                f"{np.degrees(turn):.0f} deg off (confidence {estimate.confidence:.2f})"
            )
        self.translation = max(shift, self.translation or 0.0)
        self.rotation = max(turn, self.rotation or 0.0)
