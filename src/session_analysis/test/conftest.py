"""A new study for each test."""

import pytest

from session_analysis.study.layout import init_study


@pytest.fixture
def study(tmp_path):
    return init_study(tmp_path / "study", "Training")
