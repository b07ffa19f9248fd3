"""The truth of a data set, written as an estimator would write its estimates."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

HEAD = "scene_id,im_id,obj_id,score,R,t,time"


def write_truth(
    root: Path, path: Path, moved: Callable[[np.ndarray], np.ndarray] = lambda pose: pose
) -> list[str]:
    """Write every true pose, `T_camera_model` in millimetres after `moved`; returns the lines."""
    lines = [HEAD]
    for scene in sorted((root / "test").iterdir()):
        for image, poses in json.loads((scene / "scene_gt.json").read_text()).items():
            for each in poses:
                pose = np.eye(4)
                pose[:3, :3] = np.reshape(each["cam_R_m2c"], (3, 3))
                pose[:3, 3] = each["cam_t_m2c"]
                pose = moved(pose)
                turn, shift = (
                    " ".join(map(str, part)) for part in (pose[:3, :3].ravel(), pose[:3, 3])
                )
                lines.append(f"{int(scene.name)},{image},{each['obj_id']},0.9,{turn},{shift},0.1")
    path.write_text("\n".join(lines) + "\n")
    return lines
