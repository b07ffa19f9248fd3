"""How the sources' category names map to ours, and which labelling rule each category follows.

Ours are the rows of the catalogue; a category that is not among them keeps the source's name. PACE's names
are those of its `category_names.txt` (https://github.com/qq456cvb/PACE), OmniObject3D's those of its
`raw_scans` folders; Google Scanned Objects publish none that is finer than "Consumer Goods", so theirs is
read off the product's name.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from manipose_mj.assets.categories import CATALOGUE
from manipose_mj.assets.label import ObjectType

# The rule for what nobody placed: it asks for nothing but an up axis, and the group is measured anyway.
FALLBACK_TYPE: ObjectType = "mirror"
# Of a scanned product whose name says nothing about its shape.
UNNAMED = "household_item"
# Up to so many words name an object; more describe it.
FEW_WORDS = 3


@dataclass(frozen=True)
class Kind:
    """What an object is: its category by our name, and the labelling rule."""

    category: str
    object_type: ObjectType


# Source's name: ours.
SYNONYMS: dict[str, str] = {
    # PACE
    "chip_can": "chips_can",
    "ramen_box": "box",
    "snack_box": "box",
    # OmniObject3D
    "boxed_beverage": "drinkbox",
    "canned_beverage": "can",
    "cigarette_case": "box",
    "dish": "plate",
    "dustbin": "trash_bin",
    "facial_tissue_holder": "tissue",
    "fry_pan": "pan",
    "light": "light_bulb",
    "mouse": "computer_mouse",
    "package": "box",
    "paper_box": "box",
    "red_wine_glass": "wine_glass",
    "remote_control": "remote",
    "scissors": "scissor",
    "shampoo": "bottle",
    "table_clock": "clock",
    "tape_measure": "steel_tape",
    "tissue_box": "tissue",
    "tooth_brush": "toothbrush",
    "toothpick_box": "container",
    "toy_bus": "toy_car",
    "toy_plane": "toy_airplane",
    "toy_truck": "toy_car",
    "wrench": "spanner",
}

# Categories beside ours. What is missing takes FALLBACK_TYPE.
_AXIAL = (
    "ball bucket_noodle coconut donut doughnut drum egg facial_cream garlic hami_melon hazelnut kiwifruit "
    "lemon lipstick litchi mangosteen marble mooncake mushroom onion orange passion_fruit peach "
    "persimmon pineapple ping_pong_ball plum pomegranate pumpkin rolling_pin strawberry "
    "tambourine tennis_ball tomato walnut watermelon wooden_ball"
)
_FUNCTIONAL = (
    "can_opener clip comb drill flash_light flute hair_dryer hairbrush ladle microphone "
    "pliers saxophone table_tennis_bat tongs umbrella"
)
OTHER_TYPES: dict[str, ObjectType] = {
    **dict.fromkeys(_AXIAL.split(), "axial"),
    **dict.fromkeys(_FUNCTIONAL.split(), "functional"),
}

# Words of a product's name, the most telling first, and the category they stand for; empty: the words' own.
PRODUCT_WORDS: tuple[tuple[str, str], ...] = (
    ("action figure", "figure"),
    ("teddy bear", "teddy_bear"),
    ("ink cartridge", "ink_cartridge"),
    ("screwdriver", ""),
    ("hammer", ""),
    ("wrench", "spanner"),
    ("pliers", ""),
    ("scissors", "scissor"),
    ("spatula", ""),
    ("can opener", "can_opener"),
    ("tooth brush", "toothbrush"),
    ("toothbrush", ""),
    ("toothpaste", "tooth_paste"),
    ("hair dryer", "hair_dryer"),
    ("hairbrush", ""),
    ("brush", ""),
    ("flashlight", "flash_light"),
    ("frypan", "pan"),
    ("fry pan", "pan"),
    ("skillet", "pan"),
    ("cake pan", "baking_pan"),
    ("pan", ""),
    ("teapot", ""),
    ("pitcher", ""),
    ("plant pot", "flower_pot"),
    ("flower pot", "flower_pot"),
    ("orchid pot", "flower_pot"),
    ("electric pot", "flower_pot"),
    ("planter", "flower_pot"),
    ("plant saucer", "plate"),
    ("plant bowl", "bowl"),
    ("pot", ""),
    ("mug", ""),
    ("ramekin", "bowl"),
    ("bowl", ""),
    ("bowls", "bowl"),
    ("saucer", "plate"),
    ("plate", ""),
    ("plates", "plate"),
    ("tumbler", "cup"),
    ("cup", ""),
    ("vase", ""),
    ("candle", ""),
    ("jar", ""),
    ("bottle", ""),
    ("thermos", ""),
    ("camera", ""),
    ("alarm clock", "clock"),
    ("clock", ""),
    ("mouse", "computer_mouse"),
    ("keyboard", ""),
    ("headphones", ""),
    ("headset", "headphones"),
    ("speaker", ""),
    ("remote", ""),
    ("helmet", ""),
    ("hat", ""),
    ("cap", "hat"),
    ("wallet", ""),
    ("handbag", ""),
    ("backpack", ""),
    ("bag", ""),
    ("tote", "bag"),
    ("notebook", ""),
    ("book", ""),
    ("school bus", "toy_car"),
    ("fire truck", "toy_car"),
    ("firetruck", "toy_car"),
    ("truck", "toy_car"),
    ("car", "toy_car"),
    ("airplane", "toy_airplane"),
    ("plane", "toy_airplane"),
    ("crayons", "box"),
    ("crackers", "box"),
    ("cereal", "box"),
    ("coffee mix", "box"),
    ("tea", "box"),
    ("puzzle", "box"),
    ("game", "box"),
    ("box", ""),
    ("storage bin", "container"),
    ("container", ""),
    ("basket", ""),
    ("caddy", ""),
    ("lamp", ""),
    ("toaster", ""),
    ("supplement", "bottle"),
    ("tablets", "bottle"),
    ("capsules", "bottle"),
    ("softgels", "bottle"),
    ("caplets", "bottle"),
    ("shampoo", "bottle"),
    ("conditioner", "bottle"),
    ("sandal", "shoe"),
    ("sandals", "shoe"),
    ("sneaker", "shoe"),
    ("sneakers", "shoe"),
    ("slipper", ""),
    ("boot", "shoe"),
    ("boots", "shoe"),
    ("loafer", "shoe"),
    ("moccasin", "shoe"),
    ("wingtip", "shoe"),
    ("shoe", ""),
    ("shoes", "shoe"),
    ("ball", ""),
)
_PRODUCTS = dict(PRODUCT_WORDS)
# In a product's name these also measure: "25 oz 4 cups".
_ALSO_UNITS = {"cup"}


def kind_of(name: str) -> Kind:
    """What a source's category is by our name.

    Args:
      name: The source's name, in whatever case, with spaces, hyphens or underscores.

    Returns:
      Our category, or the source's own in our spelling (letters of any script, digits, underscores; empty where
      the name has neither letter nor digit); and its type.
    """
    own = re.sub(r"[\W_]+", "_", name.lower()).strip("_")
    category = SYNONYMS.get(own, own)
    if category in CATALOGUE:
        return Kind(category, CATALOGUE[category].object_type)
    return Kind(category, OTHER_TYPES.get(category, FALLBACK_TYPE))


def kind_of_product(name: str) -> Kind:
    """What a product is, by the words of its name; `UNNAMED` where they say nothing.

    Args:
      name: Such as `"Room_Essentials_Mug_White_Yellow"` or `"BlueBowl_8oz"`.
    """
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.replace("_", " ").replace("-", " "))
    words = f" {' '.join(spaced.lower().split())} "
    for phrase, category in PRODUCT_WORDS:
        measures = phrase in _ALSO_UNITS and re.search(rf"(\d|\boz) {phrase}\b", words)
        if f" {phrase} " in words and not measures:
            return kind_of(category or phrase)
    return kind_of(UNNAMED)


def kind_of_file(name: str) -> Kind:
    """What an object is, by the words of its file's name; `UNNAMED` where they say nothing.

    Of a few words the last that is known counts, of a product's description the most telling.

    Args:
      name: Such as `"tea_spoon_2"`, `"mug.final"` or `"Threshold_Bead_Cardinal_Mug_Blue"`.
    """
    words = re.findall(r"[^\W\d_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower())
    by_last = next((kind for phrase in _from_the_last(words) if (kind := _known(phrase))), None)
    return by_last if by_last and len(words) <= FEW_WORDS else kind_of_product(name)


def _from_the_last(words: list[str]) -> Iterator[str]:
    for end in range(len(words), 0, -1):
        yield " ".join(words[max(end - 2, 0) : end])
        yield words[end - 1]


def _known(phrase: str) -> Kind | None:
    """The rigid category that a phrase names, in the singular or the plural."""
    for spelt in (phrase, phrase.removesuffix("s"), phrase.removesuffix("es")):
        kind = kind_of(_PRODUCTS.get(spelt) or spelt)
        is_known = spelt in _PRODUCTS or kind.category in CATALOGUE or kind.category in OTHER_TYPES
        if is_known and kind.object_type != "articulated":
            return kind
    return None
