"""Plans of primitives: grasps chosen, objects moved out of the way, transport."""
