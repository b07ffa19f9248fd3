"""The estimator of handles and joints: network, voting, fits."""
