"""Bad input of every kind that others write, one module for each way in."""
