"""Whether another model, though it fits better, predicts unseen torque worse."""

from __future__ import annotations

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_out import held_out
from model_discrepancy.fit.parallel import in_parallel

# Unseen plain torque that is left unexplained grows by this factor at least where a rival does
# harm; both models predict it alike otherwise, within some per cent of voluntary torque.
LEAST_HARM = 1.05


def harms(fitter: Fitter, final: Fit, other: Fit) -> bool:
    """Say whether another model predicts unseen plain torque worse than the final one by a larger
    factor than it lowers the whitened error: one with a drift that a half of the recording seems to
    show, and that the other half does not continue.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    final, other
        The present model and the other one.
    """
    now, then = in_parallel(lambda fit: held_out(fitter, fit).vaf, [final, other])
    return predicts_worse(final, now, other, then)


def predicts_worse(final: Fit, now: float, other: Fit, then: float) -> bool:
    """Say whether what another model leaves of unseen plain torque is more by a larger factor than
    it lowers the whitened error.

    Parameters
    ----------
    final, now
        The present model and its VAF on unseen data [%].
    other, then
        The other model and its VAF there.
    """
    harm = (100.0 - then) / max(100.0 - now, 1e-9)
    return harm > max(LEAST_HARM, final.score / other.score)
