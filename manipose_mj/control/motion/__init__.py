"""Collision-free motions of the arm: inverse kinematics, RRT-Connect, lines, timing."""
