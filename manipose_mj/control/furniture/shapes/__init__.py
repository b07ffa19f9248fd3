"""What clouds of furniture are made into: walls, lines of open doors, boxes of the body, parts with panels and handles that move."""
