"""The size of an effect is the torque that it makes, when, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankle_physics.term import Values, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.movements import Onsets, Peak, peak_after


@dataclass(frozen=True)
class Size:
    """Holds the torque that an effect adds.

    Attributes
    ----------
    rms
        Over the recording [N.m].
    peak
        The largest of it.
    share
        Rms as a share of the torque's, 0...1.
    """

    rms: float
    peak: Peak
    share: float


def size_of(fitter: Fitter, final: Fit, name: str, onsets: Onsets) -> Size:
    """Return the size of one term of a fitted model: prediction with it minus prediction without
    it, all else equal.
    """
    torque = _added(fitter, final, name)
    return Size(
        float(np.std(torque[fitter.rows.used])),
        peak_after(fitter.rows.rate, torque, onsets),
        torque_share(fitter, final, name),
    )


def torque_share(fitter: Fitter, final: Fit, name: str) -> float:
    """Return the rms of the torque that one term adds, as a share of the recorded torque's."""
    used = fitter.rows.used
    return float(np.std(_added(fitter, final, name)[used]) / np.std(fitter.plain_target[used]))


def _added(fitter: Fitter, final: Fit, name: str) -> np.ndarray:
    without = fitter.evaluate({n: v for n, v in final.values.items() if n != name})
    return without.plain - fitter.evaluate(final.values).plain


def sentence_of(name: str, values: Values, size: Size) -> str:
    """Return the term's sentence for these values, with its number."""
    return (
        f"{term_library()[name].sentence_for(values)} In this recording it {size.peak.sentence} "
        f"({100 * size.share:.0f} % of the torque's variation)."
    )
