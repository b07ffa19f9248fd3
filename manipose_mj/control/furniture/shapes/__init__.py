"""What furniture is made into: boxes of its body, and parts with panels and handles that move."""
