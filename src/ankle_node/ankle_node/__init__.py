"""What every node of the graph shares: parameters declared as data, block publishers and subscriptions, diagnostics, start and stop."""
