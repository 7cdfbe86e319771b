"""The four muscles, and the movement that stretches each (van 't Veld et al. 2018, III-B)."""

from __future__ import annotations

from ankle_interfaces.topics import EMG_ENSEMBLE, EMG_RESPONSES, EMG_SAMPLES, MUSCLES

DORSIFLEXING, PLANTARFLEXING = 1, -1

STRETCHED_BY = {"SOL": DORSIFLEXING, "TA": PLANTARFLEXING, "GL": DORSIFLEXING, "GM": DORSIFLEXING}
"""Direction of the movement that stretches a muscle: dorsiflexion the calf (soleus, gastrocnemius
lateralis and medialis), plantarflexion the tibialis anterior (paper, section III-B.3)."""

SAMPLES_TOPIC = EMG_SAMPLES.absolute
SAMPLE_COLUMNS = EMG_SAMPLES.columns

RESPONSE_TOPIC = EMG_RESPONSES.absolute
BACKGROUND = tuple(f"background_{muscle}[V]" for muscle in MUSCLES)
REFLEX = tuple(f"reflex_{muscle}[V.s]" for muscle in MUSCLES)
RESPONSE_COLUMNS = EMG_RESPONSES.columns
"""One row for each onset: its time, 1 dorsiflexing or -1 plantarflexing, then every muscle. A value
that could not be measured (samples missing, bad electrode) is NaN. A muscle's stretch reflex is its
value at the direction in `STRETCHED_BY`; at the other direction the same window shows cross-talk
and shortening."""

ENSEMBLE_TOPIC = EMG_ENSEMBLE.absolute
ENSEMBLE_COLUMNS = EMG_ENSEMBLE.columns
"""Running ensemble average of the rectified EMG about the onsets that stretch each muscle."""
