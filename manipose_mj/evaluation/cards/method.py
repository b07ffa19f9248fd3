"""What acted in a run, and what it was told truly: the part of a card by which two methods differ."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from manipose_mj.control.perception.source_names import masks_of
from manipose_mj.evaluation.cards.text import as_code
from manipose_mj.evaluation.policy_settings import settings_of
from manipose_mj.tasks.observations.ground_truth import told_by_all

# Without one of these a run does not tell its method.
NEEDED = ("policy", "pose", "planner", "estimator", "batch", "assets sha256")


def sources_of(run: Mapping[str, Any]) -> tuple[str, str]:
    """Where poses and where instance masks of a run came from, by what its `run.json` says that was given.

    Raises:
      InputError: Its policy cannot be read.
    """
    if run["policy"] is None:
        return run["pose"], masks_of(run["pose"])
    settings = settings_of(run["policy"])
    return settings.pose_source, settings.mask_source


def method_of(run: Mapping[str, Any]) -> dict[str, Any]:
    """The method of a run; JSON.

    Args:
      run: Content of its `run.json`, with all that is `NEEDED`.
    """
    pose, masks = sources_of(run)
    method = {
        "policy": run["policy"],
        "policy metadata": run.get("policy metadata"),
        "pose": pose,
        "masks": masks,
        "estimator": run["estimator"],
        # A policy has no planner of ours.
        "planner": run["planner"] if run["policy"] is None else None,
        "engine": run["batch"] and run["batch"]["engine"],
        "assets sha256": run["assets sha256"],
    }
    # What a run leaves at its default, older runs do not know.
    later = ("injected errors", "grasps", "estimator metadata")
    chosen = {name: run[name] for name in later if run.get(name)}
    return {**method, **chosen}


def method_text(method: Mapping[str, Any]) -> str:
    """Who acted, what was told truly and what was made wrong on purpose, in a line."""
    wrong = method.get("injected errors") or {}
    made = [f"{name.replace('_', ' ')} {value}" for name, value in wrong.items()]
    text = _policy(method) if method.get("policy") else _baseline(method)
    text += f", grasps by {method['grasps']}" if method.get("grasps") else ""
    if method.get("engine"):
        text += f"; batched worlds of engine {as_code(method['engine'])}"
    if method.get("assets sha256"):
        text += f"; builds of own assets {as_code(method['assets sha256'][:16])}"
    return text + (f"; errors made on purpose: {', '.join(made)}" if made else "")


def _policy(method: Mapping[str, Any]) -> str:
    policy = method["policy"]
    seen = policy["obs_mode"]
    told = told_by_all(seen)
    truths = [
        *(["true poses"] if told.poses else []),
        *(["true instance masks"] if told.masks else []),
    ]
    among = f", {' and '.join(truths)} among them" if truths else ""
    given = policy.get("arguments")
    text = f"policy {as_code(policy['name'])}"
    text += f" with arguments {as_code(given)}" if given else ""
    text += f", observations {as_code(seen)}{among}"
    attachment = policy.get("attachment")
    if not attachment:
        return text
    poses = "true poses" if attachment["pose_source"] == "oracle" else None
    masks = "true instance masks" if attachment["mask_source"] == "oracle" else None
    taken = " and ".join(each for each in (poses, masks) if each)
    text += "; it was given the simulator, from which it says to take "
    return (
        text + taken
        if poses
        else f"{text}{masks or 'no masks'} and poses {as_code(attachment['pose_source'])}"
    )


def _baseline(method: Mapping[str, Any]) -> str:
    who = _planner(method.get("planner") or {"kind": "rules"})
    if method["pose"] == "oracle":
        return f"{who} with true poses"
    by = _estimator(method.get("estimator"))
    if method["pose"] == "estimated_objects":
        return f"{who} with true poses of furniture, and poses of objects estimated {by}"
    return f"{who} with poses estimated {by}"


def _planner(planner: Mapping[str, Any]) -> str:
    told = f", told {as_code(planner['instruction'])}," if planner.get("instruction") else ""
    if planner["kind"] == "llm":
        return f"the baseline with plans of the language model {as_code(planner['model'])}{told}"
    if planner["kind"] == "replay":
        answers = as_code(planner["replay sha256"][:16])
        return f"the baseline with recorded plans {answers} of a language model{told}"
    return "the baseline planner"


def _estimator(estimator: Mapping[str, Any] | None) -> str:
    if not estimator:
        return "by the package's weights from true instance masks"
    arguments = estimator.get("arguments")
    given = f" with arguments {as_code(arguments)}" if arguments else ""
    meshes = " and the objects' meshes" if estimator.get("given CAD") else ""
    return f"by {as_code(estimator['name'])}{given} from true instance masks{meshes}"
