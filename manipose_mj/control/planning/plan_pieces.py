"""Pieces of a plan: what is carried out before the scene is looked at again."""

from __future__ import annotations

from manipose_mj.control.planning.check import OPEN_ENOUGH
from manipose_mj.control.planning.plan import Plan
from manipose_mj.control.scene.scene_estimate import SceneEstimate


def until_a_look(plan: Plan) -> Plan:
    """The steps up to where another part or object than the first part opened comes next.

    What a part opens shows more than was known when the plan was made.
    """
    first = plan[0].subject if plan and plan[0].primitive == "grasp_at" else None
    led = [step for step in plan[:2] if step.subject == first and step.opening is not None]
    if not led:
        return plan
    count = next((i for i, step in enumerate(plan) if step.subject != first), len(plan))
    return plan[:count]


def led_and_pushed(steps: Plan) -> tuple[Plan, ...]:
    """Steps that lead a part by its handle, and those that push it on afterwards."""
    for i in range(1, len(steps)):
        one, two = steps[i - 1], steps[i]
        if one.primitive == "release" and two.opening is not None and one.subject == two.subject:
            return steps[:i], steps[i:]
    return (steps,)


def opened_by(steps: Plan, estimate: SceneEstimate) -> tuple[str, ...]:
    """Names of the parts that steps leave open, in their order.

    Args:
      steps: Carried out.
      estimate: That they were made with.
    """
    left = {s.subject: s.opening for s in steps if s.opening is not None}
    ranges = {name: estimate.parts[name].joint.range for name in left}
    return tuple(
        name
        for name, opening in left.items()
        if opening >= ranges[name][0] + OPEN_ENOUGH * (ranges[name][1] - ranges[name][0])
    )
