"""What every node shares: declared parameters, blocks in and out, diagnostics, start and stop."""
