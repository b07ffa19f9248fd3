"""What cameras see of furniture: clouds of several views, and the handles and joints that the estimator of parts finds in them."""
