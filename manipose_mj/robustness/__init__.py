"""How far from the simulator's own world recorded plans still succeed: open-loop replays in many other worlds at once.

    manipose robustness single_object/target_pose --plan-from seeds --worlds 256

| module | holds |
|---|---|
| `variation.py` | draws of friction, mass, gains, latency and pose errors |
| `plans.py` | recorded plans of the baseline |
| `replay.py` | plans in batched worlds |
| `success_maps.py` | shares of success by what was drawn, as JSON and plots |
"""
