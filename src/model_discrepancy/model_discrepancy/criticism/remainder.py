"""What generic regressors of the movement still predict of a residual, and what chance would."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model_discrepancy.fit.fitter import MATERIAL_SHARE, Fitter
from model_discrepancy.fit.generic_bank import GenericBank, cross_score
from model_discrepancy.search.null import exceeded_by_chance

# Of what all inputs together predict, that one of them predicts alone. Missing physics answers one
# of them: in 12 recordings of an independent engine with one effect it predicted 0.39 to 1.0 of it.
# Torque that moved the plate shows only in what is left where several inputs cancel the movement:
# in three recordings without a mismatch, of 4, 11 and 59 % of the residual, none predicted any.
LEAST_ALONE = 0.1


@dataclass(frozen=True)
class Remainder:
    """Describes what the bank predicts of a residual.

    Attributes
    ----------
    share
        Of the whitened residual's power on unseen rows, 0...1; mean of both directions.
    worst
        The smaller of the two directions.
    by_input
        Share that each input's regressors predict alone.
    plain_share
        Share of the plain residual's power, on unseen rows.
    torque_share
        Power of the predicted torque as a share of the recorded torque's, without what chance
        predicts.
    by_chance
        Share that the bank exceeds by chance in `FALSE_ALARM` of recordings like this one.
    judged
        Whether what is predicted is missing physics; not where torque may have moved the plate.
    held
        Whether the movement holds no torque that no movement causes: the command is known, the
        holds tell how the servo gives way, or it holds the plate against torque.
    leaked
        Whether it is what torque did to a plate of which command or holds tell only roughly how it
        gives way.
    both_ways
        Whether each half must predict more of the other than chance does, not their mean alone.
    """

    share: float
    worst: float
    by_input: dict[str, float]
    plain_share: float
    torque_share: float = 0.0
    by_chance: float = 0.0
    judged: bool = True
    held: bool = True
    leaked: bool = False
    both_ways: bool = False

    @property
    def criticises(self) -> bool:
        """Tell whether more is predicted than chance does, in both directions, however little."""
        least = max(self.by_chance, 0.0)
        return self.share > least and self.worst > (least if self.both_ways else 0.0)

    @property
    def by_cancelling(self) -> bool:
        """Tell whether no input predicts alone what they predict together: they cancel the movement
        and leave what torque did to the plate.
        """
        return max(self.by_input.values()) < LEAST_ALONE * self.share

    @property
    def exceeds_chance(self) -> bool:
        """Tell whether more is predicted than chance does, and its torque matters."""
        return self.criticises and self.torque_share > MATERIAL_SHARE

    @property
    def significant(self) -> bool:
        """Tell whether physics is missing: more is predicted than by chance, by the movement."""
        return self.judged and self.exceeds_chance


def remainder(
    bank: GenericBank,
    fitter: Fitter,
    residual: np.ndarray,
    plain: np.ndarray,
    parts: tuple[np.ndarray, np.ndarray],
    surrogates: np.ndarray | None = None,
) -> Remainder:
    """Return what a bank predicts of this residual.

    Parameters
    ----------
    bank
        Generic regressors of the recording's movement.
    fitter
        Whose whitening applies.
    residual
        Whitened, shape (rows.count,).
    plain
        Plain, shape (rows.count,).
    parts
        Two masks of rows; each in turn is for training, the other for scoring.
    surrogates
        Of the noise in the fitted rows, shape (rows.used.sum(), draws); None leaves
        `Remainder.by_chance` at 0.
    """
    matrix = bank.whitened()
    shares = [cross_score(matrix, residual, train, test) for train, test in (parts, parts[::-1])]
    by_input = {}
    for name in dict.fromkeys(bank.inputs):
        own = matrix[:, [owner == name for owner in bank.inputs]]
        by_input[name] = float(
            np.mean(
                [cross_score(own, residual, train, test) for train, test in (parts, parts[::-1])]
            )
        )
    unfiltered = bank.plain()
    plain_share = float(
        np.mean(
            [cross_score(unfiltered, plain, train, test) for train, test in (parts, parts[::-1])]
        )
    )
    share = float(np.mean(shares))
    predicted = bank.cross_predicted(residual, parts, matrix, unfiltered)
    chance = 0.0
    if surrogates is not None:
        noise = np.zeros((len(residual), surrogates.shape[1]), dtype=surrogates.dtype)
        noise[fitter.rows.used] = surrogates
        scores = [cross_score(matrix, noise, train, test) for train, test in (parts, parts[::-1])]
        chance = exceeded_by_chance(np.mean(scores, axis=0))
    used = fitter.rows.used
    own, made = bank.cross_predicted(residual, parts, matrix), predicted
    reliable = share * float(np.var(residual[used])) / max(float(np.var(own[used])), 1e-30)
    torque_share = float(np.var(made[used]) / np.var(fitter.plain_target[used]))
    return Remainder(
        share,
        float(min(shares)),
        by_input,
        plain_share,
        torque_share * min(max(reliable, 0.0), 1.0),
        chance,
    )
