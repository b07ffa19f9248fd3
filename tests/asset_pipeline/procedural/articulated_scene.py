"""An articulated specimen on a table, and how to pull its parts."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np

from asset_pipeline.build.emit import model_element
from asset_pipeline.procedural.specimen import Specimen
from manipose_mj.assets.asset import MovingPart

TABLE = '<geom name="table" type="plane" size="2 2 1"/>'


def on_table(specimen: Specimen, folder: Path, extra: str = "") -> mujoco.MjModel:
    """The model, its files written to `folder`, with `extra` MJCF in the world."""
    root = model_element("specimen", specimen.bodies, folder)
    for element in ElementTree.fromstring(f"<extra>{TABLE}{extra}</extra>"):
        root.find("worldbody").append(element)
    ElementTree.SubElement(root, "option", cone="elliptic", impratio="10")
    ElementTree.ElementTree(root).write(folder / "model.xml")
    return mujoco.MjModel.from_xml_path(str(folder / "model.xml"))


def pull(model: mujoco.MjModel, data: mujoco.MjData, part: MovingPart, force: float) -> None:
    """Pull the part by its handle, along the handle's outward direction, for one step."""
    body = data.body(part.name)
    turn = body.xmat.reshape(3, 3)
    outwards = turn @ part.handle.rotation[:, 1]
    point = body.xpos + turn @ part.handle.origin
    data.qfrc_applied[:] = 0
    mujoco.mj_applyFT(
        model,
        data,
        force * outwards,
        np.zeros(3),
        point,
        model.body(part.name).id,
        data.qfrc_applied,
    )
    mujoco.mj_step(model, data)


def touching(model: mujoco.MjModel, shares: np.ndarray) -> list[str]:
    """Contacts, one line each, with the joints at these shares of their ranges, `(n, joints)`."""
    data = mujoco.MjData(model)
    low, high = model.jnt_range.T
    found = []
    for share in shares:
        data.qpos[: model.njnt] = low + share * (high - low)
        mujoco.mj_forward(model, data)
        for contact in data.contact:
            names = (model.geom(geom).name for geom in contact.geom)
            found.append(f"{' and '.join(names)} at {share.round(2)}")
    return found


def all_ways(joints: int, seed: int = 0) -> np.ndarray:
    """Shares of every joint's range alone, of all at random, and all open: `(n, joints)`."""
    along = np.linspace(0, 1, 12)[:, None] * np.eye(joints)[:, None, :]
    random = np.random.default_rng(seed).uniform(size=(40, joints))
    return np.concatenate([along.reshape(-1, joints), random, np.ones((1, joints))])
