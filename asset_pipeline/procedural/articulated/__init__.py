"""Generators of cabinets, microwaves and ovens, and folders of what they are made of."""
