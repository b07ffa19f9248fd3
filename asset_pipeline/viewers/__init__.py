"""The label viewer in the browser: its scene, its panel, and the session that saves labels."""
