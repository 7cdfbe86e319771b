"""Position perturbations for joint identification, sample by sample, and the node that publishes
them.
"""
