"""What an estimating agent looks through."""

from __future__ import annotations

from manipose_mj.tasks.observations.sensor_config import CameraView, SensorConfig

CAMERAS = ("front", "left", "right")
SPARE_CAMERAS = ("overview",)  # used as well when the others leave an estimate uncertain
# Behind the robot and over its shoulders: they see the front of furniture, and what leaves an estimate uncertain. The
# first is the highest.
_LOOKED_AT = (0.72, 0.0, 0.15)
FRONT_VIEWS = (
    CameraView("above", (-0.35, 0.0, 1.25), _LOOKED_AT),
    CameraView("left_shoulder", (-0.05, 0.6, 0.75), _LOOKED_AT),
    CameraView("right_shoulder", (-0.05, -0.6, 0.75), _LOOKED_AT),
)
FRONT_CAMERAS = tuple(view.name for view in FRONT_VIEWS)
# Above the first of them: fronts and bars of furniture end beyond what the others see.
WIDE_VIEW = CameraView("above_wide", (-0.35, 0.0, 1.30), _LOOKED_AT, 75.0)
HAND_CAMERA = "panda/wrist"  # looks where the hand is brought to look, nowhere else
# A depth camera's noise, at a third of its usual pixels.
SENSORS = SensorConfig(
    cameras=(*CAMERAS, *SPARE_CAMERAS, *FRONT_VIEWS, HAND_CAMERA, WIDE_VIEW),
    height=240,
    width=320,
    depth_model="structured_light",
    renderer="ray",  # colours that do not depend on the machine; nobody but estimators of others looks
)


def standing_cameras(sensors: SensorConfig) -> tuple[str, ...]:
    """The names of those that do not move, but for the wide one, in their order; where there are none, of all."""
    names = sensors.camera_names
    return tuple(name for name in names if name not in (HAND_CAMERA, WIDE_VIEW.name)) or names


def wide_cameras(sensors: SensorConfig) -> tuple[str, ...]:
    """The name of the wide one, where there is one: it shows furniture whole, and all else coarsely."""
    return tuple(name for name in sensors.camera_names if name == WIDE_VIEW.name)
