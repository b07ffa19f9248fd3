"""A language model's reply, read and resolved into a plan; nothing in it is executed as code."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from manipose_mj.control.language.completion import one_line
from manipose_mj.control.language.destinations import Destination
from manipose_mj.control.motion.motion_planner import MotionPlanner
from manipose_mj.control.planning.check import PlanState
from manipose_mj.control.planning.plan import (
    Plan,
    Step,
    plan_from_json,
    plan_schema,
    plan_to_json,
    shortened,
)
from manipose_mj.control.planning.regrasp import Poses, routes
from manipose_mj.control.planning.transport import place_at_each
from manipose_mj.control.scene.articulation import with_part_at
from manipose_mj.control.scene.scene_estimate import SceneEstimate
from manipose_mj.errors import InputError

_LONGEST = 200  # characters of a reason
_MOST_STARTS = 50  # of objects that are looked for in a reply
_THOUGHT = "</think>"


class RefusedError(Exception):
    """The model answered that the instruction cannot be carried out, or is not clear; the text says why."""


@dataclass(frozen=True)
class NamedMove:
    """`move_to` with the place it named; `step` holds the poses that are meant."""

    step: Step
    destination: str


def plain(step: Step | NamedMove) -> Step:
    """What is carried out."""
    return step.step if isinstance(step, NamedMove) else step


def step_text(step: Step | NamedMove) -> str:
    """A step as a model is told of it, such as `move_to mug, destination "table"`."""
    if isinstance(step, NamedMove):
        return f'{step.step}, destination "{step.destination}"'
    return str(step) if step.opening is None else f"{step}, opening {step.opening:.3f}"


def reply_schema(
    estimate: SceneEstimate, destinations: Mapping[str, Destination]
) -> dict[str, Any]:
    """The JSON schema of a reply: a plan whose moves name their places, or a refusal.

    Args:
      estimate: Whose names the plan may use.
      destinations: Places by name.
    """
    plan = plan_schema({*estimate.objects, *estimate.parts})
    plan.pop("$schema")
    variants = plan["items"]["anyOf"]
    for variant in variants:
        fields = variant["properties"]
        if "poses" in fields:
            del fields["poses"]
            fields["destination"] = {"type": "string", "enum": sorted(destinations)}
            variant["required"] = list(fields)
    return {
        "type": "object",
        "properties": {"plan": plan, "refusal": {"type": "string"}},
        "required": ["plan", "refusal"],
        "additionalProperties": False,
    }


def read_reply(
    text: str, estimate: SceneEstimate, destinations: Mapping[str, Destination]
) -> tuple[Step | NamedMove, ...]:
    """The steps of a reply, checked in order.

    Raises:
      RefusedError: The model declines.
      InputError: The reply is not of the schema, names something that is not there, or its steps do not find
        what they need; one line.
    """
    reply = _json_in(text)
    if not isinstance(reply, dict) or not {"plan"} <= set(reply) <= {"plan", "refusal"}:
        raise InputError('reply: expected an object with the fields "plan" and "refusal"')
    entries, refusal = reply["plan"], reply.get("refusal")
    refusal = "" if refusal is None else refusal
    if not isinstance(entries, list) or not isinstance(refusal, str):
        raise InputError('reply: "plan" is a list of steps, "refusal" is text')
    if refusal.strip():
        if entries:
            raise InputError("reply: a plan and a refusal; expected one of them")
        raise RefusedError(one_line(refusal))
    if refusal and not entries:
        raise RefusedError("it gives no reason")
    return _read_steps(entries, estimate, destinations)


def read_again(
    steps: tuple[Step | NamedMove, ...],
    estimate: SceneEstimate,
    destinations: Mapping[str, Destination],
) -> tuple[Step | NamedMove, ...]:
    """Steps of an earlier reply with their places as they are now; arguments and errors as of `read_reply`."""
    entries: list[dict[str, Any]] = []
    for each in steps:
        if isinstance(each, NamedMove):
            move = {"primitive": "move_to", "subject": each.step.subject}
            entries.append({**move, "destination": each.destination})
        else:
            entries += json.loads(plan_to_json((each,)))
    return _read_steps(entries, estimate, destinations)


def _read_steps(
    entries: list[Any], estimate: SceneEstimate, destinations: Mapping[str, Destination]
) -> tuple[Step | NamedMove, ...]:
    state = PlanState(estimate)
    steps = tuple(
        _step(entry, f"plan[{i}]", estimate, destinations, state) for i, entry in enumerate(entries)
    )
    if state.held is not None:
        raise InputError(f"plan: it ends with {state.held} in the hand; release it")
    return steps


def _json_in(text: str) -> Any:
    """What a reply holds: JSON alone, or in a fence, after a thought or among prose; of several plans, the last.

    Raises:
      InputError: There is no JSON.
    """
    text = text.rpartition(_THOUGHT)[2].strip().removeprefix("\ufeff")
    if not text:
        raise InputError("reply: it has no text; answer with the JSON object, and call no tool")
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        mistake = str(error)[:_LONGEST]
    decoder, last, place = json.JSONDecoder(), None, text.find("{")
    for _ in range(_MOST_STARTS):
        if place < 0:
            break
        try:
            found, end = decoder.raw_decode(text, place)
        except (ValueError, RecursionError):
            found, end = None, place + 1
        if isinstance(found, dict) and "plan" in found:
            last = found
        else:
            end = place + 1  # what it holds may be one
        place = text.find("{", end)
    if last is not None:
        return last
    raise InputError(
        f"reply: not valid JSON ({mistake}); answer with the JSON object only, its text in straight double quotes"
    )


def _step(
    entry: Any,
    where: str,
    estimate: SceneEstimate,
    destinations: Mapping[str, Destination],
    state: PlanState,
) -> Step | NamedMove:
    if isinstance(entry, dict) and "poses" in entry:
        raise InputError(f"{where}: no field 'poses'; a move of an object names its 'destination'")
    if isinstance(entry, dict) and entry.get("primitive") == "move_to" and len(entry) == 2:
        raise InputError(f"{where}: move_to needs one of 'destination' and 'opening'")
    if not isinstance(entry, dict) or "destination" not in entry:
        subjects = {*estimate.objects, *estimate.parts}
        try:
            (step,) = plan_from_json(json.dumps([entry]), subjects)
        except InputError as error:
            raise InputError(str(error).replace("plan[0]", where, 1)) from None
        except RecursionError:
            raise InputError(f"{where}: lists within lists; expected a step") from None
        state.carry_out(step, where)
        return step
    if set(entry) != {"primitive", "subject", "destination"} or entry["primitive"] != "move_to":
        raise InputError(f"{where}: only move_to has a 'destination', and nothing else beside it")
    subject, name = entry["subject"], entry["destination"]
    if not isinstance(subject, str) or subject not in estimate.objects:
        known = ", ".join(sorted(estimate.objects)) or "none, the scene has no objects"
        raise InputError(
            f"{where}: field 'subject' is {shortened(subject)}; expected an object: {known}"
        )
    place = destinations.get(name) if isinstance(name, str) else None
    if place is None:
        raise InputError(
            f"{where}: field 'destination' is {shortened(name)}; expected one of {', '.join(sorted(destinations))}"
        )
    if place.only_for not in (None, subject):
        raise InputError(f"{where}: {name!r} is for {place.only_for}, not for {subject}")
    if state.held != subject:
        raise InputError(f"{where}: move_to {subject}: the hand does not hold it; grasp it before")
    poses = place.poses(state.as_estimate().objects[subject], state)
    if not poses:
        raise InputError(f"{where}: {subject} does not fit {name!r} in any orientation")
    step = Step("move_to", subject, poses=poses)
    state.carry_out(step, where)
    return NamedMove(step, name)


def resolved_plans(
    steps: tuple[Step | NamedMove, ...], estimate: SceneEstimate, planner: MotionPlanner
) -> Iterator[Plan]:
    """Plans that do what the steps say: the likeliest first, then those that set an object down on the way.

    The hand may have to take an object anew to turn it over: a grasp, move and release of an object become as many as
    it needs.

    Args:
      steps: Of a reply.
      estimate: What is where.
      planner: Of motions in the scene of `estimate`.
    """
    straight = tuple(map(plain, steps))
    yield straight
    moves = [i for i, step in enumerate(steps) if isinstance(step, NamedMove)]
    if len(moves) != 1 or not 0 < moves[0] < len(steps) - 1:
        return
    at = moves[0]
    name, poses = straight[at].subject, straight[at].poses
    for stops in _stops(straight[: at - 1], name, poses, estimate, planner):
        if len(stops) > 1:
            yield straight[: at - 1] + place_at_each(name, stops) + straight[at + 2 :]


def _stops(
    before: Plan, name: str, poses: Poses, estimate: SceneEstimate, planner: MotionPlanner
) -> Iterator[tuple[Poses, ...]]:
    """Where the object may be set down on the way, with the parts open that are open by then."""
    scene = planner.scene
    for step in before:
        if step.primitive == "move_to" and step.opening is not None:
            scene = with_part_at(scene, estimate.parts[step.subject], step.opening)
    yield from routes(planner.within(scene), estimate, estimate.objects[name], poses)
