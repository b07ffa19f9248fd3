"""Results cards: what a method reached on a protocol, in a form that anybody can check against the results."""
