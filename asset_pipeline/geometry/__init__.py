"""Geometry of meshes: repair, mass, convex collision shapes, resting poses."""
