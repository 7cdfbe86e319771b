"""The curves of the angle error of several trials are compared and drawn."""

import numpy as np
import pytest

from simulation_study.human_trials import correlation, draw


def curve(middle, half, shape):
    angles = np.linspace(middle - half, middle + half, 121)
    return angles, 3e-4 * shape(angles - middle), np.full(121, 5e-5)


def test_curves_are_alike_where_they_are_so_about_their_middle():
    wave = curve(0.15, 0.03, lambda away: np.sin(2 * np.pi * away / 0.02))
    same = curve(0.2, 0.02, lambda away: np.sin(2 * np.pi * away / 0.02))
    opposite = curve(0.2, 0.04, lambda away: -np.sin(2 * np.pi * away / 0.02))
    assert correlation(wave, same) == pytest.approx(1.0, abs=0.01)
    assert correlation(wave, opposite) == pytest.approx(-1.0, abs=0.01)


def test_the_curves_of_all_trials_are_drawn(tmp_path):
    wave = curve(0.15, 0.03, lambda away: np.sin(2 * np.pi * away / 0.02))
    draw({"trial_1": wave, "trial_2": wave}, tmp_path / "angle_errors.png")
    assert (tmp_path / "angle_errors.png").stat().st_size > 5000
