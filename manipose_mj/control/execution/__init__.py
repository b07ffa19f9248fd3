"""Plans carried out on the robot, and recovery where a step fails."""
