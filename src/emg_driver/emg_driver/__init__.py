"""EMG: from the amplifier's stream to background and reflex activity for every stretch."""
