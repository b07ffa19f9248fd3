"""The registered tasks of the family `clutter`, on the built-in catalogue."""
