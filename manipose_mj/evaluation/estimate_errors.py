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
    """The largest errors of the estimates that grasps were planned with.

    Attributes:
      translation: Of the label's origin [m]; None where no grasp of anything estimated was planned.
      rotation: The least over the object's symmetry [rad]; None likewise.
    """

    def __init__(self, task: ManipulationTask, physics: mjcf.Physics, baseline: Baseline) -> None:
        self._task, self._physics, self._baseline = task, physics, baseline
        self.translation: float | None = None
        self.rotation: float | None = None
        self._seen: tuple[EstimatedPose, ...] = ()
        self._worst: EstimatedPose | None = None
        self._worst_by, self._off = 0.0, ""  # how many times the tolerance; what is said of it
        self._grasped = False  # the worst one's object, with that estimate
        self._latest: dict[str, EstimatedPose] = {}  # that were compared

    def after_planning(self) -> None:
        """Compare what the last plan was made with; the simulation has not gone on since."""
        perception = self._baseline.perception
        if not isinstance(perception, EstimatedPerception | PerturbedPerception):
            return
        self._compare_seen(perception.last_estimates)
        worst = self._worst
        if worst is not None and perception.held_name == worst.name:
            self._grasped |= np.array_equal(self._latest[worst.name].pose, worst.pose)

    def cause(self, failure: StageFailure) -> StageFailure:
        """The failure, or, where an estimate was beyond what counts as success, that of perception."""
        if self.translation is None or self.rotation is None:
            return failure
        tolerance = self._task.config.tolerance
        near = self.translation <= tolerance.translation and self.rotation <= tolerance.rotation
        if near or failure.stage in ("perception", "physics", "policy"):
            return failure
        assert self._worst is not None
        how = "was grasped with an estimate" if self._grasped else "was estimated"
        reason = f"{self._worst.name} {how} {self._off}; then {failure}"
        return StageFailure("perception", reason)

    def _compare_seen(self, estimates: tuple[EstimatedPose, ...]) -> None:
        if estimates is self._seen:
            return
        self._seen = estimates
        primitive, _, name = self._baseline.status.partition(" ")
        for estimate in estimates:
            if primitive == "grasp_at" and estimate.name == name:
                self._compare(estimate)

    def _compare(self, estimate: EstimatedPose) -> None:
        obj = self._task.objects[estimate.name]
        truth = obj.label_pose(self._physics)
        errors = pose_error(estimate.pose, truth, obj.asset.label.symmetry)
        shift, turn = float(errors[0]), float(errors[1])
        tolerance = self._task.config.tolerance
        beyond = max(shift / tolerance.translation, turn / tolerance.rotation)
        if beyond > self._worst_by:
            self._worst, self._worst_by, self._grasped = estimate, beyond, False
            self._off = (
                f"{100 * shift:.1f} cm and {np.degrees(turn):.0f} deg off "
                f"(confidence {estimate.confidence:.2f})"
            )
        self._latest[estimate.name] = estimate
        self.translation = max(shift, self.translation or 0.0)
        self.rotation = max(turn, self.rotation or 0.0)
