"""Regression on lags and hinges whose weights are a matrix of rank one: ``theta = a b^T``.

Alternating least squares (Bai 1998, Automatica 34, 333). Gram matrices are kept by stretch of the
recording, so that a part of it, or a resample, costs a sum.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.fit.generic_bank import RIDGES

# The alternation converges to 1e-3 of the weights within ten rounds from the singular vectors.
_ROUNDS = 12


class Products:
    """Holds Gram matrices of one input's columns and the residual, by stretch.

    Parameters
    ----------
    columns
        Shape (rows, p), p = lags x hinges, lags outermost.
    residual
        Shape (rows,).
    stretches
        Rows of each.

    Attributes
    ----------
    gram
        Shape (S, p, p), p = lags x hinges; columns have unit mean square.
    right
        Columns times residual, shape (S, p).
    power
        Of the residual, shape (S,).
    """

    def __init__(
        self, columns: np.ndarray, residual: np.ndarray, stretches: list[np.ndarray]
    ) -> None:
        self.gram = np.stack([columns[rows].T @ columns[rows] for rows in stretches])
        self.right = np.stack([columns[rows].T @ residual[rows] for rows in stretches])
        self.power = np.array([float(residual[rows] @ residual[rows]) for rows in stretches])
        self.count = np.array([len(rows) for rows in stretches])


def rank_one(products: Products, chosen: np.ndarray, hinges: int, ridge: float) -> np.ndarray:
    """Return the weights of shape (p,) of rank one: alternating ridge regression of lags and hinges
    on the chosen stretches.
    """
    count = float(products.count[chosen].sum())
    gram, right = (
        products.gram[chosen].sum(axis=0) / count,
        products.right[chosen].sum(axis=0) / count,
    )
    full = np.linalg.solve(gram + ridge * np.eye(len(gram)), right).reshape(-1, hinges)
    u, s, v = np.linalg.svd(full, full_matrices=False)
    a, b = u[:, 0] * s[0], v[0]
    blocks = gram.reshape(len(a), hinges, len(a), hinges)
    turned = np.ascontiguousarray(blocks.transpose(1, 0, 3, 2))
    sides = right.reshape(len(a), hinges)
    for _ in range(_ROUNDS):
        b = b / np.linalg.norm(b)
        a = np.linalg.solve(b @ (blocks @ b) + ridge * np.eye(len(a)), sides @ b)
        size = float(a @ a)
        if size == 0.0:
            break
        b = np.linalg.solve(a @ (turned @ a) + ridge * size * np.eye(hinges), a @ sides)
    return np.outer(a, b).ravel()


def share_of(products: Products, weights: np.ndarray, chosen: np.ndarray) -> float:
    """Return the share of the residual's power on the chosen stretches that these weights predict;
    may be negative.
    """
    gram, right = products.gram[chosen].sum(axis=0), products.right[chosen].sum(axis=0)
    return float(2.0 * weights @ right - weights @ gram @ weights) / float(
        products.power[chosen].sum()
    )


def tuned_ridge(products: Products, train: np.ndarray, hinges: int) -> float:
    """Return the ridge that does best on the last third of the training stretches when fitted to
    the first two.
    """
    cut = max(1, 2 * len(train) // 3)
    scores = [
        share_of(products, rank_one(products, train[:cut], hinges, ridge), train[cut:])
        for ridge in RIDGES
    ]
    return RIDGES[int(np.argmax(scores))]


def predicted_share(products: Products, hinges: int) -> float:
    """Return the share predicted on unseen stretches, mean of both directions between even and odd
    ones.
    """
    parts = np.arange(0, len(products.power), 2), np.arange(1, len(products.power), 2)
    shares = []
    for train, test in (parts, parts[::-1]):
        weights = rank_one(products, train, hinges, tuned_ridge(products, train, hinges))
        shares.append(share_of(products, weights, test))
    return float(np.mean(shares))
