"""What an evaluation leaves on disk: one JSON line per episode, and one trajectory file.

Both are written so that a process killed at any instant leaves only whole records behind, but for
one line at the end of `results.jsonl` that lacks its newline, which the reader drops.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.failures import STAGES


@dataclass(frozen=True)
class EpisodeResult:
    """How one episode ended; every field but `wall_s` and `policy_s` repeats bit for bit from the seed.

    Attributes:
      task: `"domain/task"`.
      episode: Index within the evaluation, from 0.
      seed: The episode's own seed.
      object: Name of the manipulated asset; where there are several objects, the first one's.
      pose_source: Where the policy took object poses from: `"oracle"` from the simulator, `"estimated"`,
        `"estimated_objects"`, or `"none"` where it got none.
      success_once: The goal was met at some control step.
      success_at_end: The goal was met when the episode ended.
      failure: A member of `STAGES`, or None on success at the end.
      reason: One line that says what failed; empty on success.
      translation_error: Symmetric pose error to the goal at the end [m], the largest of all goals' objects; None where it
        has no meaning or, in batched worlds, was not measured.
      rotation_error: The same for the rotation [rad].
      steps: Control steps taken.
      sim_time: Simulated time [s].
      max_penetration: Deepest contact over the episode [m]; None in batched worlds, which do not measure it.
      wall_s: Wall-clock time [s].
      estimate_translation_error: Largest error of an estimate that a grasp was planned with, whatever came of it [m];
        None for true poses, and where no grasp was planned.
      estimate_rotation_error: The same for the rotation, the least over the symmetry [rad].
      decisions: Times the policy was asked.
      clipped_actions: Actions with a number beyond its limit.
      policy_s: Wall-clock time in the policy, of `wall_s` [s].
      mask_source: Where it took instance masks from: `"oracle"` from the simulator, or `"none"` where it got none;
        None in older records.
    """

    task: str
    episode: int
    seed: int
    object: str
    pose_source: str
    success_once: bool
    success_at_end: bool
    failure: str | None
    reason: str
    translation_error: float | None
    rotation_error: float | None
    steps: int
    sim_time: float
    max_penetration: float | None
    wall_s: float
    estimate_translation_error: float | None = None
    estimate_rotation_error: float | None = None
    decisions: int = 0
    clipped_actions: int = 0
    policy_s: float = 0.0
    mask_source: str | None = None

    def __post_init__(self) -> None:
        if self.failure is not None and self.failure not in STAGES:
            raise ValueError(f"failure is {self.failure!r}; expected one of {', '.join(STAGES)}")
        if self.success_at_end != (self.failure is None):
            raise ValueError("an episode has a failure exactly when it does not succeed at its end")

    @property
    def key(self) -> tuple[str, int]:
        """What names the episode within an evaluation."""
        return self.task, self.episode


@dataclass(frozen=True)
class Trajectory:
    """Enough of an episode to draw it again.

    Attributes:
      times: `(t,)` [s], about every 0.1 s.
      qpos: `(t, nq)`, the model's generalized positions.
      annotations: `t` strings, the primitive under way at each instant.
      raised: Traceback of what somebody's policy or estimator raised in the end; not part of what is drawn.
        Empty: nothing.
    """

    times: Float[np.ndarray, "t"]
    qpos: Float[np.ndarray, "t nq"]
    annotations: list[str]
    raised: str = ""


# Fields that older records lack.
_SINCE = {
    "estimate_translation_error": None,
    "estimate_rotation_error": None,
    "decisions": 0,
    "clipped_actions": 0,
    "policy_s": 0.0,
    "mask_source": None,
}


def to_line(result: EpisodeResult) -> str:
    """The result as one line of JSON, with its newline; NumPy scalars become plain numbers.

    Raises:
      ValueError: A number is not finite.
    """
    return json.dumps(asdict(result), allow_nan=False, default=lambda v: v.item()) + "\n"


def from_line(line: str) -> EpisodeResult:
    """The result that `to_line` wrote.

    Raises:
      ValueError: The line is not one whole record, a value is of another type than its field, or the episode succeeded
        at its end and never.
    """
    document = json.loads(line)
    names = [f.name for f in fields(EpisodeResult)]
    if not isinstance(document, dict) or sorted({**_SINCE, **document}) != sorted(names):
        raise ValueError(f"expected an object with the fields {', '.join(names)}")
    for field in fields(EpisodeResult):
        value = document.get(field.name, _SINCE.get(field.name))
        if not any(_is_of(value, kind) for kind in str(field.type).split(" | ")):
            raise ValueError(f"{field.name} is {value!r:.80}; expected {field.type}")
    if document["success_at_end"] and not document["success_once"]:
        raise ValueError("success_at_end is true and success_once is not")
    return EpisodeResult(**document)


def _is_of(value: Any, kind: str) -> bool:
    """Whether a JSON value is of the type that a field's annotation names."""
    if isinstance(value, bool):
        return kind == "bool"
    if kind == "float":
        return isinstance(value, int | float) and math.isfinite(value)
    kinds: dict[str, type] = {"str": str, "int": int, "None": type(None)}
    return kind in kinds and isinstance(value, kinds[kind])


def storable(text: str) -> str:
    """What a stranger says, as UTF-8 can hold it: half a pair of characters, as of bytes that are no text, is escaped."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def read_results(path: Path) -> tuple[list[EpisodeResult], int]:
    """The whole records of a `results.jsonl`, and the length [bytes] of the part that holds them.

    A last line without its newline, which a killed process left unfinished, is not part of either.

    Raises:
      InputError: A line with its newline is not a record, or an episode occurs twice.
    """
    if not path.exists():
        return [], 0
    results: list[EpisodeResult] = []
    seen: set[tuple[str, int]] = set()
    size = 0
    whole = path.read_bytes().split(b"\n")[:-1]
    for number, raw in enumerate(whole, start=1):
        try:
            result = from_line(raw.decode("utf-8"))
        except ValueError as error:
            raise InputError(f"{path}: line {number} is not an episode's result: {error}") from None
        if result.key in seen:
            task, episode = result.key
            raise InputError(f"{path}: line {number} repeats episode {episode} of {task}")
        seen.add(result.key)
        results.append(result)
        size += len(raw) + 1
    return results, size


def write_atomically(path: Path, content: bytes) -> None:
    """Replace the file's content in one step: a reader sees the old or the new, never a part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    staging = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with staging.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        staging.replace(path)
    finally:
        staging.unlink(missing_ok=True)


def write_sorted(path: Path, results: Iterable[EpisodeResult]) -> None:
    """Rewrite a `results.jsonl` in the order of task and episode."""
    ordered = sorted(results, key=lambda r: r.key)
    write_atomically(path, "".join(map(to_line, ordered)).encode("utf-8"))


def trajectory_path(out: Path, task: str, episode: int) -> Path:
    """Where an evaluation in the folder `out` keeps an episode's trajectory."""
    return out / "episodes" / task.replace("/", "__") / f"{episode:05d}.npz"


def write_trajectory(path: Path, trajectory: Trajectory) -> None:
    """Save a trajectory, compressed."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        times=np.asarray(trajectory.times, np.float64),
        qpos=np.asarray(trajectory.qpos, np.float32),
        annotations=np.asarray(trajectory.annotations, dtype=np.str_),
    )
    write_atomically(path, buffer.getvalue())


def read_trajectory(path: Path) -> Trajectory:
    """Load what `write_trajectory` saved.

    Raises:
      InputError: The file is missing or is not a trajectory.
    """
    try:
        with np.load(path, allow_pickle=False) as arrays:
            data: dict[str, Any] = {k: arrays[k] for k in ("times", "qpos", "annotations")}
    except (OSError, KeyError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a trajectory ({error})") from None
    return Trajectory(data["times"], data["qpos"], data["annotations"].tolist())
