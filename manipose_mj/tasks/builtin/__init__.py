"""The registered tasks; importing this registers them."""

from manipose_mj.tasks.builtin import articulated, clutter, single_object

__all__ = ["articulated", "clutter", "single_object"]
