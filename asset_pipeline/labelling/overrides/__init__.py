"""A person's corrections of labels: reading, applying and writing `labels.yaml`."""
