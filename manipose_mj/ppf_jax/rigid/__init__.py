"""The estimator of rigid objects: pair features, network, voting, refinement."""
