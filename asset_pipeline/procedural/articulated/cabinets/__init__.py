"""Cabinets: kinds, layouts, sizes, carcasses, fronts."""
