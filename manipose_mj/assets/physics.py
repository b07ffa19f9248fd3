"""The physics of every scene, in one place: integrator, friction cones, solver, contacts, what counts as rest."""

from __future__ import annotations

import mujoco

# Groups of geoms: sensors see 0 to 2; collision shapes are in 3.
COLLISION_GROUP, VISUAL_GROUP = 3, 2
# MuJoCo's contacts soften with the mass of what they push; with the default impedance a light box
# that an arm sets down sinks 7 mm into the table, with these less than 1 mm. A first impedance
# above 0.8 makes thin objects with many contacts chatter.
SOLREF = (0.01, 1.0)
SOLIMP = (0.8, 0.999, 0.001)
# Of contacts between objects, furniture and table in a task's scene [s], half of what the assets' models state: what
# the arm flings at 2 m/s then dents the table by 4 mm, not 7. The least that MuJoCo takes is two time steps.
SCENE_CONTACT_TIME = 0.005
# Of what objects stand on: tables, boards, planes.
SUPPORT_FRICTION, SUPPORT_CONDIM = (0.8, 0.005, 0.0001), 4
TIMESTEP = 0.002  # [s]
GRAVITY = 9.81  # [m/s^2]
# An elliptic cone with so stiff a friction keeps what is held or piled from creeping. MuJoCo's no-slip solver would
# too, at a multiple of the time: `benchmarks/physics_options.py`.
INTEGRATOR, CONE, IMPRATIO = "implicitfast", "elliptic", 100.0
# Below these speeds [m/s, rad/s] a body is at rest.
REST_LINEAR_SPEED, REST_ANGULAR_SPEED = 0.01, 0.1


def set_physics(option: mujoco.MjOption, timestep: float) -> None:
    """The benchmark's integrator, friction cones and solver, with this step [s]."""
    option.timestep = timestep
    option.cone = getattr(mujoco.mjtCone, f"mjCONE_{CONE.upper()}")
    option.impratio = IMPRATIO
    option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{INTEGRATOR.upper()}")
