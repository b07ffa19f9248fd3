"""The registered tasks of the family `articulated`: their furniture and objects are drawn from all that there are."""

from __future__ import annotations

from dataclasses import dataclass, replace

from manipose_mj.assets.asset import Asset, MovingPart
from manipose_mj.tasks.articulated.object_draw import (
    RequestedFurniture,
    furniture_alone,
    with_cavity,
)
from manipose_mj.tasks.articulated.open_close import OpenClose, OpenCloseConfig
from manipose_mj.tasks.articulated.part_choice import PartChoice, named_part
from manipose_mj.tasks.articulated.placement import Standing
from manipose_mj.tasks.articulated.store import Store, StoreConfig
from manipose_mj.tasks.articulated.take_out import TakeOut, TakeOutConfig
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import DrawnTaskFactory, register_task
from manipose_mj.tasks.core.scene_objects import SceneObjects

_ANY_CABINET = ("cabinet",)
_OWN_CABINET = ("cabinet", "table", "refrigerator")  # of users: what has drawers and upright doors
# How many other objects may lie in a cavity when something is stored there, and when it is taken out.
_STORED_BESIDE, _LEFT_INSIDE = 2, 1
# Things rock on an oven's grid and on the rim of a turntable [s].
_SETTLE_INSIDE = 2.0
# A door half open would be where the hand is at home.
_PAST_HOME = (0.9, 1.0)
_CANS_IN_DRAWERS = RequestedFurniture(
    _ANY_CABINET, PartChoice(("drawer",), "middle"), ("chips_can",), own=_OWN_CABINET
)


@register_task(
    "articulated",
    "store_chips_can_middle_drawer",
    tags=("articulated", "store"),
    draws=with_cavity(_CANS_IN_DRAWERS, taken=False, fillers=0),
)
def store_chips_can_middle_drawer(env_config: EnvConfig, objects: SceneObjects) -> Store:
    """Store the chips can in the middle drawer: open it, lay the can inside, shut it."""
    config = StoreConfig(standing=OPENABLES["middle_drawer"].standing)
    return Store(*_cavity_scene(objects), env_config, config)


@dataclass(frozen=True)
class Openable:
    """A kind of part that tasks open, shut, fill and empty.

    Attributes:
      phrase: What it is, for descriptions.
      requested: The furniture and its parts.
      standing: Where the furniture stands where things are put into it or taken out.
      start_open: How far open it is when it is to be shut, of its range.
      shut: By which fraction of its range it must be shut after something was stored or taken out;
        None: to within the tolerance.
    """

    phrase: str
    requested: RequestedFurniture
    standing: Standing = Standing(objects=True)
    start_open: tuple[float, float] = (0.6, 1.0)
    shut: float | None = None


# Where the hand gets at the handle and into the cavity, with the objects to the right.
_BESIDE = Standing((0.73, 0.78), (0.06, 0.20), turn=(-0.3, 0.04), objects=True)
_BEFORE = Standing((0.67, 0.74), (-0.22, -0.07), turn=(-0.03, 0.32), objects=True)

OPENABLES: dict[str, Openable] = {
    **{
        f"{level}_drawer": Openable(
            f"the {level} drawer of a cabinet",
            RequestedFurniture(_ANY_CABINET, PartChoice(("drawer",), level), own=_OWN_CABINET),
            # The hand gets at a handle from the front only with room below.
            replace(_BESIDE, plinth=(0.15, 0.15) if level == "bottom" else (0.0, 0.0)),
            # Wide open, the top drawer would be where the hand is at home.
            start_open=(0.5, 0.7),
        )
        for level in ("top", "middle", "bottom")
    },
    "cabinet_door": Openable(
        "a door of a cabinet",
        # Doors that lift are real cupboards' alone.
        RequestedFurniture(_ANY_CABINET, PartChoice(("door", "flap")), own=_OWN_CABINET),
        _BEFORE,
        start_open=_PAST_HOME,
        shut=0.95,
    ),
    "microwave": Openable(
        "a microwave",
        RequestedFurniture(("microwave",), PartChoice(("door", "flap")), own=("microwave",)),
        replace(_BEFORE, plinth=(0.10, 0.10)),
        start_open=_PAST_HOME,
        shut=0.95,
    ),
    "oven": Openable(
        "an oven, whose door is hinged at the bottom",
        RequestedFurniture(("oven",), PartChoice(("flap", "door")), own=("oven", "dishwasher")),
        replace(_BEFORE, bearing=(-0.07, 0.07), turn=(-0.17, 0.17), plinth=(0.12, 0.12)),
        shut=0.95,
    ),
}


def _open(part: Openable) -> DrawnTaskFactory:
    factory = _moving(part, OpenCloseConfig(requested="open"))
    factory.__doc__ = f"""Open {part.phrase}, by nine tenths of its range or more.

    It is shut at first. Which piece and which of its parts changes from episode to episode.
    """
    return factory


def _close(part: Openable) -> DrawnTaskFactory:
    config = OpenCloseConfig(requested="shut", start_open=part.start_open)
    factory = _moving(part, config)
    factory.__doc__ = f"""Shut {part.phrase}, by nine tenths of its range or more.

    It is open by {part.start_open[0]:.0%} to {part.start_open[1]:.0%} at first. Which piece and which of its parts
    changes from episode to episode.
    """
    return factory


def _store(part: Openable) -> DrawnTaskFactory:
    config = StoreConfig(
        standing=part.standing, shut=part.shut, max_fillers=_STORED_BESIDE, settle=_SETTLE_INSIDE
    )

    def factory(env_config: EnvConfig, objects: SceneObjects) -> Store:
        return Store(*_cavity_scene(objects), env_config, config)

    factory.__doc__ = f"""Store an object in {part.phrase}: open it, put the object inside, shut it.

    The object starts on the table, in any of its stable poses, and has to lie so that it fits the
    cavity. Up to two other objects lie there already. It counts where the object is (all of it inside,
    at rest, released) and that the drawer or door is shut.
    """
    return factory


def _take_out(part: Openable) -> DrawnTaskFactory:
    config = TakeOutConfig(
        standing=part.standing, shut=part.shut, max_fillers=_LEFT_INSIDE, settle=_SETTLE_INSIDE
    )

    def factory(env_config: EnvConfig, objects: SceneObjects) -> TakeOut:
        return TakeOut(*_cavity_scene(objects), env_config, config)

    factory.__doc__ = f"""Take an object out of {part.phrase}: open it, set the object down, shut it.

    The object lies near the cavity's open side; another one may lie there too. It counts that the
    object rests on the table in the marked area, released, and that the drawer or door is shut.
    """
    return factory


def _moving(part: Openable, config: OpenCloseConfig) -> DrawnTaskFactory:
    def factory(env_config: EnvConfig, objects: SceneObjects) -> OpenClose:
        (furniture,) = objects.assets
        return OpenClose(furniture, _part(objects), env_config, config)

    return factory


def _cavity_scene(objects: SceneObjects) -> tuple[tuple[Asset, ...], Asset, MovingPart]:
    furniture, *others = objects.assets
    return tuple(others), furniture, _part(objects)


def _part(objects: SceneObjects) -> MovingPart:
    assert objects.part is not None
    return named_part(objects.assets[0], objects.part)


for _name, _openable in OPENABLES.items():
    for _verb, _make, _draws in (
        ("open", _open, furniture_alone(_openable.requested)),
        ("close", _close, furniture_alone(_openable.requested)),
        ("store", _store, with_cavity(_openable.requested, taken=False, fillers=_STORED_BESIDE)),
        ("take_out", _take_out, with_cavity(_openable.requested, taken=True, fillers=_LEFT_INSIDE)),
    ):
        register_task(
            "articulated",
            f"{_verb}_{_name}",
            tags=("articulated", _verb),
            draws=_draws,
            rigid=_verb in ("store", "take_out"),
        )(_make(_openable))
