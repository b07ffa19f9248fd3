"""The commands `manipose assets build`, `check`, `fetch`, `label` and `relabel`."""
