"""The Franka Panda: kinematics, collision geometry, MJCF model, composer entity."""
