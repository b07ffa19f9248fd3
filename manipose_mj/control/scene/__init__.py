"""The scene as it is estimated, and as planning collides with it."""
