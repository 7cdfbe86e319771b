"""The session with a subject: program, protocol, and the rig's services."""
