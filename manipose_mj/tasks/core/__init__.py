"""What all tasks share: configuration, contract, starts of episodes, environment, registry, randomisation, snapshots."""
