"""What tables and files of pictures call a run: who acted, and what it was told of objects."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from manipose_mj.control.perception.source_names import GraspSource, default_grasps
from manipose_mj.errors import InputError
from manipose_mj.evaluation.cards.method import method_of, sources_of
from manipose_mj.evaluation.cards.run_record import RunRecord

# In this order on the page of the documentation; others follow as they come.
PUBLISHED = ("true", "true, other seeds", "estimated")
_POSES = {
    "oracle": "true",
    "estimated": "estimated",
    "estimated_objects": "estimated objects",
    "none": "no poses",
}
_RULES = "rules"


def poses_of(run: Mapping[str, Any]) -> str:
    """What a run was told of objects, by whom, and of which starts; of a policy, also its name.

    Args:
      run: Content of its `run.json`.
    """
    source, _ = sources_of(run)
    words = [_POSES.get(source, source)]
    if run.get("policy"):
        words.insert(0, f"policy {run['policy']['name']}")
    if run.get("estimator"):
        words[-1] += f" by {run['estimator']['name']}"
        words += ["given CAD"] if run["estimator"].get("given CAD") else []
    if run.get("batch"):
        words.append(f"engine {run['batch']['engine']}")
    if (seed := run.get("resample")) is not None:
        words.append("other seeds" if seed == 1 else f"other seeds {seed}")
    if run.get("protocol") != "v1":
        words.append(f"protocol {run.get('protocol')}")
    for name, value in (run.get("injected errors") or {}).items():
        sizes = value if isinstance(value, list) else [] if value is True else [f"{value:g}"]
        words.append(" ".join([name.replace("_", " "), *sizes]))
    return _in_a_cell(", ".join(words))


def grasps_of(run: Mapping[str, Any]) -> GraspSource:
    """Where the grasps of a run of the baseline came from; older runs do not say so."""
    return run.get("grasps") or ("annotated" if run.get("pose") == "oracle" else "shape")


def planner_of(run: Mapping[str, Any]) -> str:
    """Who made the plans: rules, a language model by its name, recorded answers by their hash, or a policy itself."""
    if run.get("policy"):
        return "policy"
    planner = run.get("planner") or {}
    kind = planner.get("kind", _RULES)
    whose = {"llm": planner.get("model", ""), "replay": planner.get("replay sha256", "")[:8]}
    return _in_a_cell(f"{kind} {whose.get(kind, '')}".strip())


def label_of(run: Mapping[str, Any]) -> str:
    """`poses_of`, and what differs from the baseline with its default grasps and plans by rules."""
    words = [poses_of(run)]
    if not run.get("policy"):
        grasps, planner = grasps_of(run), planner_of(run)
        words += [] if grasps == default_grasps(run["pose"]) else [f"{grasps} grasps"]
        words += [] if planner == _RULES else [planner]
    return ", ".join(words)


def check_labels(records: Sequence[RunRecord]) -> None:
    """Nothing, if runs of one label are runs of one method.

    Raises:
      InputError: They are not; one line says in what they differ.
    """
    methods: dict[str, dict[str, Any]] = {}
    for record in records:
        run = record.run
        method = {name: value for name, value in method_of(run).items() if value}
        method["grasps"] = grasps_of(run)
        first = methods.setdefault(label_of(run), method)
        differ = sorted(k for k in {*first, *method} if first.get(k) != method.get(k))
        if differ:
            raise InputError(
                f"two runs of {label_of(run)!r} differ in {', '.join(differ)}; tabulate one at a time"
            )


def in_order(labels: Sequence[str]) -> list[str]:
    """Each label once: those of `PUBLISHED` first."""
    return list(dict.fromkeys([*(name for name in PUBLISHED if name in labels), *labels]))


def as_file_name(label: str) -> str:
    """A label as part of a file's name."""
    return re.sub(r"[^\w.]+", "-", label).strip("-")


def _in_a_cell(text: str) -> str:
    """Text as a cell of a table can hold it."""
    return " ".join(text.replace("|", "/").split())
