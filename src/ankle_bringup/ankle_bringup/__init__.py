"""Launch files, configurations and the ankle command that runs all of it."""
