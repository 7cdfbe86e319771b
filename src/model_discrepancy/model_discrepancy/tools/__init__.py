"""Questions beside the diagnosis: compare two bags, design an experiment, simulate a recording
again.
"""
