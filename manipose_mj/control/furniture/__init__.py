"""Furniture and surroundings as clouds show them: handles, joints, cavities, boxes to keep clear of."""
