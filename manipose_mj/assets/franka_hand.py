"""The Franka hand: published sizes and force, collision boxes of hand and fingers, contact of the pads.

Source: "Franka Hand" data sheet (70 N, 80 mm, 50 mm/s a finger) and franka_ros. Boxes cover the manufacturer's visual
meshes. The robot's model, the sampling of grasps and their trials all take these numbers from here.
"""

from __future__ import annotations

Box = tuple[tuple[float, float, float], tuple[float, float, float]]  # lower and upper corner [m]

TCP_OFFSET = 0.1034  # hand to tool centre point along z [m]
FINGER_OFFSET = 0.0584  # hand to finger frames along z [m]
MAX_OPENING = 0.08  # between the pads [m]
GRIP_FORCE = 70.0  # continuous, on each pad [N]
FINGER_SPEED = 0.05  # of one finger [m/s]

# Body, flange and cable plug, in the hand's frame.
HAND_BOXES: tuple[Box, ...] = (
    ((-0.0205, -0.1025, -0.008), (0.0205, 0.1025, 0.066)),
    ((-0.0315, -0.036, -0.008), (0.0315, 0.036, 0.012)),
    ((-0.007, -0.104, -0.026), (0.007, -0.045, -0.008)),
)
# Of the finger that moves towards +y, in its frame: base, middle, tip; the other is its half turn about z. The
# inner faces of the boxes above the pad are where the mesh has them, so that the pads touch first.
FINGER_BOXES: tuple[Box, ...] = (
    ((-0.0105, 0.0103, 0.0), (0.0105, 0.0258, 0.0195)),
    ((-0.0095, 0.0080, 0.0195), (0.0095, 0.0230, 0.036)),
    ((-0.0088, 0.0030, 0.036), (0.0088, 0.0145, 0.054)),
)
PAD_HALF_WIDTH, PAD_HALF_HEIGHT, PAD_THICKNESS = 0.0088, 0.009, 0.003  # [m]
_PAD_CENTRE = TCP_OFFSET - FINGER_OFFSET
PAD_BOX: Box = (
    (-PAD_HALF_WIDTH, 0.0, _PAD_CENTRE - PAD_HALF_HEIGHT),
    (PAD_HALF_WIDTH, PAD_THICKNESS, _PAD_CENTRE + PAD_HALF_HEIGHT),
)

# The grip reaches its full force on objects thicker than 70 N / 14 kN/m = 5 mm.
GRIPPER_STIFFNESS = 14000.0  # [N/m] of the opening
# At full force a free finger travels at the data sheet's speed.
FINGER_DAMPING = GRIP_FORCE / FINGER_SPEED  # [N s/m]
# Reflected mass of the drive [kg]. Below damping x time step the contact solver, which ignores the
# implicit damping, lets the grip force chatter.
FINGER_ARMATURE = 3.0

# Sliding: silicone rubber on dry plastic, card or paint is 0.8 to 1.2. Torsion [m]: two thirds of
# the radius of a 7 mm contact patch, which point contacts lack.
PAD_FRICTION = (1.0, 0.005, 0.0001)
PAD_CONDIM = 4
# Stiff, whatever the robot hits: at 2 m/s MuJoCo's usual 20 ms would let the arm sink in by 15 mm.
ROBOT_SOLREF, ROBOT_SOLIMP = (0.005, 1.0), (0.95, 0.99, 0.001, 0.5, 2.0)
