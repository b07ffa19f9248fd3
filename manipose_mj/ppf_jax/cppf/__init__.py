"""CPPF as published (You et al. 2022), which tables compare with."""
