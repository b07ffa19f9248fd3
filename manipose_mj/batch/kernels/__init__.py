"""Kernels of the engine `warp`: our own, and all of them compiled ahead of the first step."""
