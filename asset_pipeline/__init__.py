"""From raw scans to labelled assets with convex collision shapes; and the procedural catalogue.

    files --fetching, sources--> Scan --labelling--> PoseLabel --geometry--> parts, mass --build--> asset folder
    numbers --procedural--> Specimen --catalogue, geometry, build--> asset folder

| folder | holds |
|---|---|
| `fetching/` | downloads of the data sets whose licences allow it, and steps for the others |
| `sources/` | readers of what publishers ship: a `Scan`, or an `ArticulatedScan`, of each object |
| `labelling/` | pose labels, handles and cavities from shapes; a person's corrections of them |
| `geometry/` | repair, convex decomposition, mass, stable poses |
| `procedural/` | generators of the built-in objects: one module a category in `axial/`, `mirror/`, `functional/`, `articulated/` |
| `catalogue/` | built-in objects built, one by one or in parallel, and drafted for pictures |
| `build/` | what writes asset folders: grasp trials, MJCF, resumable parallel builds, relabelling |
| `checks/` | whether built assets load, rest and open, and whether cavities take a ball |
| `viewers/` | labels in the browser, seen and put right |
| `cli/` | the commands `manipose assets build`, `check`, `fetch`, `label`, `relabel` |

It depends on `manipose_mj.assets`, the contract, and `manipose_mj.grasp_sampling`, and knows of no robot or task.
"""
