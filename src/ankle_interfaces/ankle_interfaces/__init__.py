"""Blocks of samples: the message format of every sampled signal, its units, gaps and resampling."""
