"""The commands `manipose pose ...`: train, evaluate and average estimators, render clouds."""
