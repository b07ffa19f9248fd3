"""The registered tasks of the family `articulated`, on the built-in catalogue."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

from manipose_mj.assets import catalogue
from manipose_mj.assets.asset import Asset
from manipose_mj.assets.categories import Split
from manipose_mj.errors import InputError
from manipose_mj.tasks.articulated.cavity_placement import ways_to_lie
from manipose_mj.tasks.articulated.furniture import Standing, split_objects
from manipose_mj.tasks.articulated.open_close import OpenClose, OpenCloseConfig
from manipose_mj.tasks.articulated.part_choice import PartChoice, choose_part
from manipose_mj.tasks.articulated.store import Store, StoreConfig
from manipose_mj.tasks.articulated.take_out import TakeOut, TakeOutConfig
from manipose_mj.tasks.core.config import EnvConfig
from manipose_mj.tasks.core.registry import TaskFactory, register_task

DRAWER = PartChoice(("drawer",), "middle")


@register_task("articulated", "store_chips_can_middle_drawer", tags=("articulated", "store"))
def store_chips_can_middle_drawer(env_config: EnvConfig) -> Store:
    """Store the red chips can in the middle drawer: open it, lay the can inside, shut it."""
    can = 0 if env_config.split == "train" else _TEST_INSTANCE
    chosen = env_config.assets()
    objects = (catalogue.load("chips_can", can),) if chosen is None else chosen
    if len(objects) != 1:
        raise InputError(f"store_chips_can_middle_drawer takes one object; got {len(objects)}")
    cabinet = catalogue.load("cabinet", _CABINETS[env_config.split][0])
    return Store(objects, (cabinet,), DRAWER, env_config)


@dataclass(frozen=True)
class Openable:
    """A kind of part that tasks open, shut, fill and empty.

    Attributes:
      phrase: What it is, for descriptions.
      category: Of the furniture.
      choice: Which part of it.
      instances: Of the category, for training and for testing.
      stored: What is stored there, categories and indices for training; the test objects are
        instance 4 of the same categories.
      standing: Where the furniture stands.
      start_open: How far open it is when it is to be shut, of its range.
      shut: By which fraction of its range it must be shut after something was stored or taken out;
        None: to within the tolerance.
    """

    phrase: str
    category: str
    choice: PartChoice
    instances: dict[Split, tuple[int, ...]]
    stored: tuple[tuple[str, int], ...]
    standing: Standing = field(default_factory=Standing)
    start_open: tuple[float, float] = (0.6, 1.0)
    shut: float | None = None

    def furniture(self, env_config: EnvConfig) -> tuple[Asset, ...]:
        """The user's furniture, or the built-in of the split."""
        own, _ = split_objects(env_config.assets())
        if own:
            return own
        return tuple(catalogue.load(self.category, i) for i in self.instances[env_config.split])

    def objects_and_furniture(
        self, env_config: EnvConfig
    ) -> tuple[tuple[Asset, ...], tuple[Asset, ...]]:
        """The user's rigid objects, or those of the built-in ones of the split that fit; furniture."""
        furniture = self.furniture(env_config)
        _, own = split_objects(env_config.assets())
        if own:
            return own, furniture
        if env_config.split == "train":
            candidates = [catalogue.load(category, i) for category, i in self.stored]
        else:
            categories = dict.fromkeys(category for category, _ in self.stored)
            candidates = [catalogue.load(category, _TEST_INSTANCE) for category in categories]
        parts = [choose_part(asset, self.choice, hollow=True) for asset in furniture]
        fitting = [
            a for a in candidates if any(p.cavity and ways_to_lie(a, p.cavity) for p in parts)
        ]
        # Where nothing fits, the task says so.
        return tuple(fitting or candidates), furniture


_TEST_INSTANCE = 4
_CABINETS: dict[Split, tuple[int, ...]] = {"train": (0, 3), "test": (14,)}
# No bowls: they are held by the rim, from above, where behind a door there is no room.
_FLAT = (("chips_can", 0), ("mug", 0), ("mug", 1), ("box", 1))
_SMALL = (("chips_can", 1), ("mug", 0), ("mug", 1), ("box", 1))
# Things rock on an oven's grid and on the rim of a turntable [s].
_SETTLE_INSIDE = 1.2
# A door half open would be where the hand is at home.
_PAST_HOME = (0.9, 1.0)

OPENABLES: dict[str, Openable] = {
    **{
        f"{level}_drawer": Openable(
            f"the {level} drawer of a cabinet",
            "cabinet",
            PartChoice(("drawer",), level),
            _CABINETS,
            _FLAT,
            # The hand gets at a handle from the front only with room below.
            Standing(plinth=0.15 if level == "bottom" else 0.0),
            # Wide open, the top drawer would be where the hand is at home.
            start_open=(0.5, 0.7),
        )
        for level in ("top", "middle", "bottom")
    },
    "cabinet_door": Openable(
        "the door of a cabinet",
        "cabinet",
        PartChoice(("door",)),
        _CABINETS,
        _SMALL,
        Standing(x=(0.66, 0.72), y=(-0.15, -0.05)),
        start_open=_PAST_HOME,
        shut=0.95,
    ),
    "microwave": Openable(
        "a microwave",
        "microwave",
        PartChoice(("door", "flap")),
        {"train": (0, 8), "test": (14,)},
        _SMALL,
        Standing(x=(0.66, 0.72), y=(-0.15, -0.05), plinth=0.10),
        start_open=_PAST_HOME,
        shut=0.95,
    ),
    "oven": Openable(
        "an oven, whose door is hinged at the bottom",
        "oven",
        PartChoice(("flap", "door")),
        {"train": (7, 18), "test": (9,)},
        _SMALL,
        Standing(x=(0.68, 0.72), y=(-0.05, 0.05), yaw=radians(6), plinth=0.12),
        shut=0.95,
    ),
}


def _open(part: Openable) -> TaskFactory:
    factory = _moving(part, "open", OpenCloseConfig(requested="open", standing=part.standing))
    factory.__doc__ = f"""Open {part.phrase}, by nine tenths of its range or more.

    It is shut at first. Any articulated asset that has such a part with a handle can take its place.
    """
    return factory


def _close(part: Openable) -> TaskFactory:
    config = OpenCloseConfig(requested="shut", standing=part.standing, start_open=part.start_open)
    factory = _moving(part, "close", config)
    factory.__doc__ = f"""Shut {part.phrase}, by nine tenths of its range or more.

    It is open by {part.start_open[0]:.0%} to {part.start_open[1]:.0%} at first. Any articulated asset that has such
    a part with a handle can take its place.
    """
    return factory


def _store(part: Openable) -> TaskFactory:
    config = StoreConfig(
        standing=part.standing, shut=part.shut, max_fillers=2, settle=_SETTLE_INSIDE
    )

    def factory(env_config: EnvConfig) -> Store:
        return Store(*part.objects_and_furniture(env_config), part.choice, env_config, config)

    factory.__doc__ = f"""Store an object in {part.phrase}: open it, put the object inside, shut it.

    The object starts on the table, in any of its stable poses, and has to lie so that it fits the
    cavity. Up to two other objects lie there already. It counts where the object is (all of it inside,
    at rest, released) and that the drawer or door is shut.
    """
    return factory


def _take_out(part: Openable) -> TaskFactory:
    config = TakeOutConfig(
        standing=part.standing, shut=part.shut, max_fillers=1, settle=_SETTLE_INSIDE
    )

    def factory(env_config: EnvConfig) -> TakeOut:
        return TakeOut(*part.objects_and_furniture(env_config), part.choice, env_config, config)

    factory.__doc__ = f"""Take an object out of {part.phrase}: open it, set the object down, shut it.

    The object lies near the cavity's open side; another one may lie there too. It counts that the
    object rests on the table in the marked area, released, and that the drawer or door is shut.
    """
    return factory


def _moving(part: Openable, verb: str, config: OpenCloseConfig) -> TaskFactory:
    def factory(env_config: EnvConfig) -> OpenClose:
        _refuse_rigid(env_config, verb)
        return OpenClose(part.furniture(env_config), part.choice, env_config, config)

    return factory


def _refuse_rigid(env_config: EnvConfig, verb: str) -> None:
    for asset in env_config.assets() or ():
        if asset.kind != "articulated":
            raise InputError(
                f"{asset.folder}: is a {asset.kind} asset; tasks that {verb} take articulated ones"
            )


for _name, _part in OPENABLES.items():
    for _verb, _make in (
        ("open", _open),
        ("close", _close),
        ("store", _store),
        ("take_out", _take_out),
    ):
        register_task("articulated", f"{_verb}_{_name}", tags=("articulated", _verb))(_make(_part))
