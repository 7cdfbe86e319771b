"""The blind study: cases of the independent rig with sealed truth, diagnosed and scored."""
