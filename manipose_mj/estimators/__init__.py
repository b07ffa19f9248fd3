"""Anyone's pose estimators: what they get, what they give, and how they are found.

| module | holds |
|---|---|
| `observation` | the dictionary that an estimator gets for each object a camera sees |
| `answer` | the checks on what it gives back |
| `settings` | which one an evaluation asks, and whether it gets the object's mesh |
| `loading` | estimators by name: `package.module:factory`, or `ws://host:port` |
| `service` | an estimator behind these checks, in this process or on a server |
| `view_evaluation` | its poses for all views of a table |
"""
