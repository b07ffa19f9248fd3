"""Pictures of what a camera saw, with the true and the estimated frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float

from manipose_mj.ppf_jax.points.clouds import LabelledCloud

_COLOURS = ("tab:red", "tab:green", "tab:blue")  # X, Y, Z
_PLANES = ((0, 1, "from the camera"), (2, 1, "from its right"))


def draw_view(
    path: Path, cloud: LabelledCloud, estimate: Float[np.ndarray, "4 4"], title: str
) -> None:
    """Draw one view as the camera sees it and from its right-hand side.

    Args:
      path: PNG to write.
      cloud: What was seen; its label's axes are drawn solid, as long as half the object.
      estimate: `T_camera_label`, drawn dashed.
      title: Above both.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 4.2), layout="constrained")
    length = 0.5 * float(np.max(cloud.extents))
    middle = cloud.points.mean(axis=0)
    points = 100 * (cloud.points - middle)
    for axes, (across, down, name) in zip(figure.subplots(1, 2), _PLANES, strict=True):
        shade = points[:, ({0, 1, 2} - {across, down}).pop()]
        axes.scatter(
            points[:, across], points[:, down], c=shade, s=3, cmap="Greys_r", vmin=-10, vmax=15
        )
        for pose, style in ((cloud.pose, "-"), (estimate, "--")):
            start = 100 * (pose[:3, 3] - middle)
            for column, colour in enumerate(_COLOURS):
                end = start + 100 * length * pose[:3, column]
                axes.plot(
                    [start[across], end[across]], [start[down], end[down]], style, c=colour, lw=2
                )
        # What bled in from the background is not of interest.
        low, high = (np.quantile(points, q, axis=0) for q in (0.02, 0.98))
        room = 100 * length
        axes.set_xlim(low[across] - room, high[across] + room)
        axes.set_ylim(low[down] - room, high[down] + room)
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.set_title(name, fontsize="small")
        axes.set_xlabel("cm")
    figure.suptitle(f"{title}\nsolid: label, dashed: estimate; X red, Y green, Z blue", fontsize=9)
    figure.savefig(path, dpi=100)
