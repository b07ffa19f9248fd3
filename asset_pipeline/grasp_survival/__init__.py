"""How surely each grasp of an object holds: all grasps under many frictions and errors of the hand, at once.

    manipose assets grasps DIR --engine warp

| module | holds |
|---|---|
| `grid.py` | which trials there are |
| `trial_model.py` | the hand and object of `build.grasp_trial`, with the friction and motion of each trial |
| `engine_c.py` | trials on the CPU, in processes |
| `engine_warp.py`, `warp_kernels.py` | trials on an NVIDIA GPU, all at once |
| `survival.py` | the result and its file beside the asset |
"""
