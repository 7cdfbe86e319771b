"""The provenance of an estimate is one line of YAML: estimator, settings, model and rig.

It is published latched on ``/impedance/provenance`` and written into every bag of estimates, so
that estimates of different origin are never compared as if they were of one. The model itself goes
with it on ``/impedance/model``, so that a bag is enough to make its estimates again.
"""

from __future__ import annotations

from dataclasses import asdict
from hashlib import sha256
from typing import Any

import yaml

from impedance_estimator.stream import EstimateStream


def provenance(stream: EstimateStream) -> str:
    """Return one line of YAML that says what a stream's estimates are made with.

    Parameters
    ----------
    stream
        Its algorithm, settings and known physics count.

    Returns
    -------
    str
        Keys ``algorithm``, ``settings``, ``model`` and ``rig``, without a line break. Model and rig
        are each a title with the SHA-256 of its content, or null where there is none.
    """
    known = stream.known
    model = known.subject if known is not None else None
    rig = known.rig if known is not None else None
    content: dict[str, Any] = {
        "algorithm": stream.algorithm,
        "settings": asdict(stream.settings),
        "model": model and {"title": model.title, "sha256": model.sha256},
        "rig": rig and {"title": rig.title, "sha256": sha256(rig.text().encode()).hexdigest()},
    }
    return yaml.safe_dump(content, default_flow_style=True, width=10**6).strip()


def model_text(stream: EstimateStream) -> str:
    """Return the text of the model file that a stream's estimates are made with; empty where there
    is none.

    Parameters
    ----------
    stream
        Its known physics counts.
    """
    subject = stream.known.subject if stream.known is not None else None
    return subject.text() if subject is not None else ""
