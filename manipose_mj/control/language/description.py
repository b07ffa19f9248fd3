"""What a language model is told: the rules of plans, the scene in words and numbers, and what is wanted."""

from __future__ import annotations

from collections.abc import Mapping

from manipose_mj.control.language.destinations import Destination
from manipose_mj.control.language.part_descriptions import words_for_parts
from manipose_mj.control.planning.check import PlanState
from manipose_mj.control.scene.scene_estimate import ObjectEstimate, PartEstimate, SceneEstimate

RULES = """\
You plan for one robot arm with a parallel gripper. Answer with JSON only: {"plan": [...], "refusal": ""}.
Steps of a plan:
- {"primitive": "grasp_at", "subject": NAME}: the empty hand takes hold of an object, or of a part by its handle.
- {"primitive": "move_to", "subject": NAME, "destination": PLACE}: the object in the hand is brought to a place of the list.
- {"primitive": "move_to", "subject": PART, "opening": NUMBER}: the part in the hand is moved until its joint is at NUMBER; \
with an empty hand the part is pushed, which is enough to shut it.
- {"primitive": "release", "subject": NAME}: the hand lets go.
Rules:
- The hand holds one thing at a time, and is empty at the end.
- Open a drawer or door, and let go of its handle, before you put something inside or take something out. Open it nearly all the way.
- Shut a part again only if that is asked for.
- Something that is asked for may be unseen: open the part that it may be in, let go of the handle, and end the plan there. \
What shows then comes with the next question.
- Use names, places and openings of the scene only.
- What is done so far is listed, if anything is: plan only what is left of the instruction.
- When the instruction cannot be carried out in this scene, or fits several things of it equally well, answer with an empty plan \
and say why in "refusal". When everything is as asked for already, answer with an empty plan and an empty refusal.\
"""


def scene_text(estimate: SceneEstimate, destinations: Mapping[str, Destination]) -> str:
    """The scene in lines: objects, parts and places, in the world's frame, z up [m, rad]."""
    lines = ["Objects:"]
    state = PlanState(estimate)
    objects = [_object_line(obj, state) for obj in estimate.objects.values()]
    objects += [_unseen_line(name, kind) for name, kind in estimate.unseen.items()]
    lines += objects or ["- none"]
    lines.append("Parts, the highest first:")
    words = words_for_parts(estimate.parts)
    lines += [_part_line(part, words[part.name]) for part in _from_above(estimate)] or ["- none"]
    lines.append("Places:")
    lines += [
        f'- "{name}": {place.text}' + (f"; only for {place.only_for}" if place.only_for else "")
        for name, place in destinations.items()
    ]
    return "\n".join(lines)


def _object_line(obj: ObjectEstimate, state: PlanState) -> str:
    x, y, z = (float(v) for v in obj.label_pose[:3, 3])
    sizes = " x ".join(f"{float(v):.2f}" for v in obj.label.extents)
    up = float(obj.label_pose[2, 0])
    stands = "upright" if up > 0.9 else "upside down" if up < -0.9 else "lying"
    around = state.part_around(obj.label_pose)
    where = f"inside {around}" if around else "not in any part"
    graspable = "" if len(obj.grasps.poses) else ", too large for the gripper"
    colours = f"{obj.colours}, " if obj.colours else ""
    return f"- {obj.name}: {_kind(obj.category)}{colours}{sizes} m, middle at ({x:.2f}, {y:.2f}, {z:.2f}), {stands}, {where}{graspable}"


def _unseen_line(name: str, category: str) -> str:
    return f"- {name}: {_kind(category)}unseen; a shut part or another object may hide it"


def _kind(category: str) -> str:
    return f"a {category.replace('_', ' ')}, " if category else ""


def _from_above(estimate: SceneEstimate) -> list[PartEstimate]:
    """Parts by their handles: the highest first, of one height the leftmost."""
    handles = {name: part.handle_pose[:3, 3] for name, part in estimate.parts.items()}
    order = sorted(
        handles, key=lambda name: (-round(float(handles[name][2]), 2), -handles[name][1])
    )
    return [estimate.parts[name] for name in order]


def _part_line(part: PartEstimate, words: str) -> str:
    low, high = part.joint.range
    unit = "m" if part.joint.kind == "slide" else "rad"
    x, y, z = (float(v) for v in part.handle_pose[:3, 3])
    room = "encloses nothing"
    if part.cavity is not None:
        sizes = " x ".join(f"{float(v):.2f}" for v in part.cavity.extents)
        room = f"closes a room of {sizes} m"
    return (
        f"- {part.name}: {words}, its joint is at {part.opening:.3f} {unit}, shut at {low:.3f}, wide open at {high:.3f}; "
        f"handle at ({x:.2f}, {y:.2f}, {z:.2f}); {room}"
    )
