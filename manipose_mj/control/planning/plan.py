"""Plans as data: a JSON list of `move_to`, `grasp_at` and `release`, checked before it is run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.poses import pose_to_vector, vector_to_pose

Primitive = Literal["move_to", "grasp_at", "release"]

_LONGEST = 200  # characters of a value in a message
_FIELDS: dict[str, Any] = {
    "poses": {
        "description": "where the object's label may end, any of them will do",
        "type": "array",
        "minItems": 1,
        "items": {
            "description": "x y z [m] and unit quaternion w x y z, world frame",
            "type": "array",
            "items": {"type": "number"},
            "minItems": 7,
            "maxItems": 7,
        },
    },
    "opening": {"description": "position of the part's joint [m or rad]", "type": "number"},
}


def plan_schema(subjects: Iterable[str] = ()) -> dict[str, Any]:
    """The JSON schema of a plan, for structured output of a language model.

    Args:
      subjects: Names that the plan may use; any by default.
    """
    subject: dict[str, Any] = {
        "type": "string",
        "description": "an object's or a moving part's name",
    }
    if names := sorted(subjects):
        subject["enum"] = names

    def step(primitives: list[str], *fields: str) -> dict[str, Any]:
        properties = {"primitive": {"type": "string", "enum": primitives}, "subject": subject}
        properties |= {field: _FIELDS[field] for field in fields}
        return {
            "type": "object",
            "properties": properties,
            "required": list(properties),
            "additionalProperties": False,
        }

    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "type": "array",
        "items": {
            "anyOf": [
                step(["grasp_at", "release"]),
                step(["move_to"], "poses"),
                step(["move_to"], "opening"),
            ]
        },
    }


@dataclass(frozen=True)
class Step:
    """One primitive.

    Attributes:
      primitive: `grasp_at` takes hold of the subject, `move_to` brings the held subject to one of
        `poses` or to `opening`, `release` lets go of it and backs off. While nothing is held, `move_to` pushes.
      subject: Name of an object or of a moving part.
      poses: `T_world_label` for an object that is moved; any of them will do.
      opening: Joint position for a part that is moved [m or rad].
    """

    primitive: Primitive
    subject: str
    poses: tuple[Float[np.ndarray, "4 4"], ...] = ()
    opening: float | None = None

    def __str__(self) -> str:
        return f"{self.primitive} {self.subject}"


Plan = tuple[Step, ...]


@dataclass(frozen=True)
class CandidatePlan:
    """One of several plans, worked out only when it is asked for.

    Attributes:
      steps: Works out the plan.
      contact_allowance: How far loose objects may be pushed aside while it is carried out [m].
    """

    steps: Callable[[], Plan]
    contact_allowance: float = 0.0


def plan_to_json(plan: Plan) -> str:
    """The plan as JSON text, as `plan_schema` describes it."""
    entries = []
    for step in plan:
        entry: dict[str, Any] = {"primitive": step.primitive, "subject": step.subject}
        if step.poses:
            entry["poses"] = [[round(float(v), 6) for v in pose_to_vector(p)] for p in step.poses]
        if step.opening is not None:
            entry["opening"] = round(float(step.opening), 6)
        entries.append(entry)
    return json.dumps(entries, indent=1)


def plan_from_json(text: str, subjects: set[str]) -> Plan:
    """Read a plan; nothing in it is executed as code.

    Args:
      text: JSON.
      subjects: Names that the plan may use.

    Raises:
      InputError: Not JSON, not of the schema, or about something that is not there.
    """
    try:
        entries = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"plan: not valid JSON ({error})") from None
    if not isinstance(entries, list):
        raise InputError(f"plan: a {type(entries).__name__}; expected a list of steps")
    return tuple(_step(entry, f"plan[{i}]", subjects) for i, entry in enumerate(entries))


def shortened(value: Any) -> str:
    """A value as one line that is not too long to be told."""
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _step(entry: Any, where: str, subjects: set[str]) -> Step:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: a {type(entry).__name__}; expected an object")
    extra = set(entry) - {"primitive", "subject", "poses", "opening"}
    if extra:
        raise InputError(f"{where}: unknown field {shortened(sorted(extra)[0])}")
    primitive, subject = entry.get("primitive"), entry.get("subject")
    if primitive not in ("move_to", "grasp_at", "release"):
        raise InputError(
            f"{where}: field 'primitive' is {shortened(primitive)}; expected move_to, grasp_at or release"
        )
    if not isinstance(subject, str) or subject not in subjects:
        raise InputError(
            f"{where}: field 'subject' is {shortened(subject)}; expected one of {', '.join(sorted(subjects))}"
        )
    poses, opening = entry.get("poses"), entry.get("opening")
    if (primitive == "move_to") != ((poses is None) != (opening is None)):
        raise InputError(f"{where}: move_to needs one of 'poses' and 'opening', the others neither")
    if poses is not None:
        if not isinstance(poses, list) or not poses:
            raise InputError(f"{where}: field 'poses' is not a list of poses")
        return Step(primitive, subject, poses=tuple(_pose(p, where) for p in poses))
    if opening is not None and not _numbers([opening], 1):
        raise InputError(
            f"{where}: field 'opening' is {shortened(opening)}; expected a number [m or rad]"
        )
    return Step(primitive, subject, opening=None if opening is None else float(opening))


def _pose(value: Any, where: str) -> Float[np.ndarray, "4 4"]:
    vector = np.asarray(value, float) if _numbers(value, 7) else np.zeros(7)
    if not np.isfinite(vector).all() or abs(np.linalg.norm(vector[3:]) - 1) > 1e-2:
        raise InputError(f"{where}: a pose is not x y z [m] and a unit quaternion w x y z")
    return vector_to_pose(vector)


def _numbers(values: Any, count: int) -> bool:
    return (
        isinstance(values, list)
        and len(values) == count
        and all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
        and all(abs(v) < 1e6 for v in values)  # Python reads NaN and Infinity from JSON
    )
