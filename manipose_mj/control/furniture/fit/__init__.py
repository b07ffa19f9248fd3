"""From clouds and sensed parts to a piece of furniture in boxes: parts shut, handles and hinges where the clouds have them."""
