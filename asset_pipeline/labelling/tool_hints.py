"""What a category's name says about a tool that its shape does not: which end works, where it begins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class ToolHint:
    """How to read the sections of one kind of tool.

    Attributes:
      works: Which end is the functional one: the `"wide"` one, whose sections are the longest, or the
        `"thin"` one, whose sections cover the least.
      leaves: What tells the functional area from the grip: the whole `"section"`, or its `"thickness"`
        alone, the smaller width, where the grip varies in the larger (a pen's clip, scissors' loops).
      joint: The `"first"` clear change of the section after the grip, or the `"largest"`.
      step: The least change of the section that counts, as the logarithm of its widths' ratios.
      begun: The share of the step at which the functional area begins: most of it where the grip
        flares into it.
      straight: Which part's centres the axis goes through: the `"grip"`, or the `"functional"` area
        where the grip is two unequal loops.
    """

    works: Literal["wide", "thin"] = "thin"
    leaves: Literal["section", "thickness"] = "section"
    joint: Literal["first", "largest"] = "first"
    step: float = 0.35
    begun: float = 0.25
    straight: Literal["grip", "functional"] = "grip"


# An unknown tool is taken to work with its thin end, as knives, drivers and pens do.
UNKNOWN = ToolHint()

HINTS: dict[str, ToolHint] = {
    "brush": ToolHint("wide", joint="largest"),
    "cutter": ToolHint("thin", step=0.15),
    "drill": ToolHint("thin", joint="largest", straight="functional"),
    "dustpan": ToolHint("wide", joint="largest", begun=0.85),
    "fork": ToolHint("wide", begun=0.18),
    "hammer": ToolHint("wide", joint="largest"),
    "knife": ToolHint("thin", "thickness"),
    "marker": ToolHint("thin"),
    "pan": ToolHint("wide", joint="largest"),
    "pen": ToolHint("thin", "thickness", begun=0.12),
    "pencil": ToolHint("thin", begun=0.12),
    "razor": ToolHint("wide"),
    "scissor": ToolHint("thin", "thickness", joint="largest", straight="functional"),
    "screwdriver": ToolHint("thin", joint="largest"),
    "spanner": ToolHint("wide", begun=0.5),
    "spatula": ToolHint("wide"),
    "spoon": ToolHint("wide"),
    "squeegee": ToolHint("wide"),
    "toothbrush": ToolHint("wide"),
}
