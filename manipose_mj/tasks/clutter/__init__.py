"""The family `clutter`: objects picked out of piles."""
