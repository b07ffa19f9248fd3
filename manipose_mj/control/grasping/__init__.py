"""Grasps of objects and handles with the motions that reach them."""
