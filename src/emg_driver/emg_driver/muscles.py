"""The four muscles of van 't Veld et al.

2018, section III-B, and the movement that stretches each.
"""

from __future__ import annotations

DORSIFLEXING, PLANTARFLEXING = 1, -1

STRETCHED_BY = {"SOL": DORSIFLEXING, "TA": PLANTARFLEXING, "GL": DORSIFLEXING, "GM": DORSIFLEXING}
"""Direction of the movement that stretches a muscle: dorsiflexion the calf (soleus, gastrocnemius
lateralis and medialis), plantarflexion the tibialis anterior (paper, section III-B.3)."""

MUSCLES = tuple(STRETCHED_BY)

SAMPLES_TOPIC = "/emg/samples"
SAMPLE_COLUMNS = ("t[s]", *(f"{muscle}[V]" for muscle in MUSCLES))

RESPONSE_TOPIC = "/emg/responses"
BACKGROUND = tuple(f"background_{muscle}[V]" for muscle in MUSCLES)
REFLEX = tuple(f"reflex_{muscle}[V.s]" for muscle in MUSCLES)
RESPONSE_COLUMNS = ("t[s]", "direction[1]", *BACKGROUND, *REFLEX)
"""One row for each onset: its time, 1 dorsiflexing or -1 plantarflexing, then every muscle. A value
that could not be measured (samples missing, bad electrode) is NaN. A muscle's stretch reflex is its
value at the direction in `STRETCHED_BY`; at the other direction the same window shows cross-talk
and shortening."""

ENSEMBLE_TOPIC = "/emg/ensemble"
ENSEMBLE_COLUMNS = ("lag[s]", *(f"{muscle}[V]" for muscle in MUSCLES))
"""Running ensemble average of the rectified EMG about the onsets that stretch each muscle."""
