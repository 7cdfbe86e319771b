"""How the driver reaches a rig: one module a line, each with its class `Link` (see `rig_link`).

`protocol` is what all lines that carry the packets of docs/rig_protocol.md share.
"""
