"""A folder like MuJoCo Menagerie's, with one large mesh on the Panda's hand."""

from __future__ import annotations

from pathlib import Path

PANDA = """<mujoco><compiler meshdir="assets"/><asset><mesh file="hand.obj"/></asset><worldbody>
<body name="hand"><geom class="visual" material="white" mesh="hand"/></body></worldbody></mujoco>"""
TETRAHEDRON = """v -.2 -.2 0
v .2 -.2 0
v 0 .3 0
v 0 0 .1
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""


def write_menagerie(root: Path, panda: str = PANDA, mesh: str = TETRAHEDRON) -> Path:
    """Write `root`/franka_emika_panda with this panda.xml and this hand.obj; returns `root`."""
    folder = root / "franka_emika_panda"
    (folder / "assets").mkdir(parents=True)
    (folder / "panda.xml").write_text(panda, encoding="utf-8")
    (folder / "assets" / "hand.obj").write_text(mesh, encoding="utf-8")
    return root
