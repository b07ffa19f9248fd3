"""BOP's CSV of estimates: `scene_id,im_id,obj_id,score,R,t,time`, millimetres and seconds."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from manipose_mj.errors import InputError
from manipose_mj.poses import compose

COLUMNS = ("scene_id", "im_id", "obj_id", "score", "R", "t", "time")
_RIGID = 1e-2  # how far a rotation may be from orthonormal: some write four digits


@dataclass(frozen=True)
class Estimate:
    """A line of the file.

    Attributes:
      scene, image, model: Their numbers.
      score: Higher is surer.
      pose: `T_camera_model` [m].
      seconds: Spent on the whole image; -1 where unknown.
    """

    scene: int
    image: int
    model: int
    score: float
    pose: Float[np.ndarray, "4 4"]
    seconds: float

    @property
    def key(self) -> tuple[int, int, int]:
        """Scene, image and model."""
        return self.scene, self.image, self.model


def read_results(path: Path) -> list[Estimate]:
    """The estimates of a file.

    Raises:
      InputError: The file is missing, lacks a column, or a line holds no estimate; one line says which.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            found = list(_estimates(path, csv.reader(file)))
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not a CSV file ({error})") from None
    times: dict[tuple[int, int], float] = {}
    for estimate in found:
        image = (estimate.scene, estimate.image)
        if times.setdefault(image, estimate.seconds) != estimate.seconds:
            raise InputError(
                f"{path}: scene {image[0]} image {image[1]} has several times; BOP's is of the whole image"
            )
    return found


def _estimates(path: Path, rows: Iterator[list[str]]) -> Iterator[Estimate]:
    head = [word.strip() for word in next(rows, [])]
    for name in COLUMNS:
        if name not in head:
            raise InputError(f"{path}: no column {name!r}; expected {','.join(COLUMNS)}")
    for number, row in enumerate(rows, start=2):
        if not row:
            continue
        if len(row) != len(head):
            raise InputError(f"{path}: line {number} has {len(row)} fields; expected {len(head)}")
        try:
            yield _estimate(dict(zip(head, row, strict=True)))
        except ValueError as error:
            raise InputError(f"{path}: line {number}: {error}") from None


def _estimate(fields: dict[str, str]) -> Estimate:
    scene, image, model = (int(fields[name]) for name in COLUMNS[:3])
    score, seconds = _numbers(fields, "score", 1)[0], _numbers(fields, "time", 1)[0]
    rotation = _numbers(fields, "R", 9).reshape(3, 3)
    if (
        not np.allclose(rotation @ rotation.T, np.eye(3), atol=_RIGID)
        or np.linalg.det(rotation) < 0
    ):
        raise ValueError("R is not a rotation")
    pose = compose(rotation, _numbers(fields, "t", 3) / 1000)
    return Estimate(scene, image, model, float(score), pose, float(seconds))


def _numbers(fields: dict[str, str], name: str, count: int) -> Float[np.ndarray, "n"]:
    values = np.array([float(word) for word in fields[name].split()])
    if values.shape != (count,):
        raise ValueError(f"{name} has {len(values)} numbers; expected {count}")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} is not finite")
    return values
