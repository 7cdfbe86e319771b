"""A virtual rig and subject behind the topics of the real one."""
