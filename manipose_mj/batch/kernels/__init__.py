"""Code that is compiled: loops over worlds of the engine `c`; kernels of the engine `warp`, ahead of the first step."""
