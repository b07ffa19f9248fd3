"""Demonstrations: recorded episodes of the baseline, in ManiSkill's layout.

| module | holds |
|---|---|
| `layout.py` | the files of a data set |
| `record.py`, `attempts.py` | recording, resumable |
| `replay.py` | replaying, with observations and other control modes |
| `observation_tape.py` | observations, written as they come |
| `playback.py` | a recording as a policy |
| `lerobot_export.py` | export by LeRobot's writer |
"""
