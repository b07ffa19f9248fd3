"""MuJoCo Warp's physics step with fewer kernels, for worlds of few degrees of freedom; needs `pip install -e ".[gpu]"`."""
