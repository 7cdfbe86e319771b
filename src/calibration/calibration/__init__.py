"""What is measured once and then known: the rig (``rig.yaml``), the session (``subject.yaml``)."""
