"""Changes to training clouds: outliers, swapped parts, stretching, tapering."""
