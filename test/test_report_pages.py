"""Reports fit every screen: no words over one another, none cut; what is wide scrolls by itself."""

import numpy as np
import pytest
from report_pictures import problems

from ankle_interfaces.block import Block
from impedance_estimator.offline.recorded_estimates import estimate_bag
from model_discrepancy.report.html_report import html_list, html_table, write_page
from session_analysis import html_page
from session_analysis.estimate_answer import answer
from session_analysis.estimate_report import write_estimates as write_answer
from session_analysis.recording_page import write_recording_page
from session_analysis.study.recording_results import Row
from session_analysis.study.study_report import write_study_report
from session_recorder.bag_writer import BagWriter

pytestmark = [pytest.mark.live, pytest.mark.untimed]

PHONE = {"width": 390, "height": 800}
HEAD = ["effect", "in a model without it", "in the whole model", "what was recorded with it"]
ROW = ["short_range_stiffness_of_the_plantarflexors", "K = 97.8 N.m/rad", "65.5 +- 6.3", "yes"]
RATE = 1000  # Hz
COLUMNS = ("t[s]", "position[rad]", "torque[N.m]")
LONG_NAME = "distributed_short_range_stiffness_and_a_name_that_has_no_blank_in_it_at_all_for_a_line"


def write_diagnosis(path):
    write_page("A diagnosis", [html_list([LONG_NAME]), html_table(HEAD, [ROW])], path)


def write_estimates(path):
    parts = [html_page.bullets([LONG_NAME]), html_page.table([HEAD, ROW])]
    path.write_text(html_page.page("Estimates", parts, interactive=False), encoding="utf-8")


@pytest.mark.parametrize("write", [write_diagnosis, write_estimates])
def test_a_report_is_as_wide_as_the_screen_and_its_tables_scroll(browser, tmp_path, write):
    write(tmp_path / "report.html")
    page = browser.new_page(viewport=PHONE, is_mobile=True, device_scale_factor=2)
    page.goto((tmp_path / "report.html").as_uri())
    try:
        assert page.evaluate("[innerWidth, document.documentElement.scrollWidth]") == [390, 390]
        shown, whole = page.evaluate(
            "(() => { const box = document.querySelector('table').parentElement;"
            " return [box.clientWidth, box.scrollWidth]; })()"
        )
        assert shown < 390 < whole
    finally:
        page.close()


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A bag of an ankle without reflexes under random steps, and the bag of its estimates."""
    folder = tmp_path_factory.mktemp("recording")
    random = np.random.default_rng(1)
    steps = np.repeat(random.uniform(-0.03, 0.03, 120), 200)
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, 1 / RATE)
    torque = 0.0137 * np.gradient(velocity, 1 / RATE) + 0.6 * velocity + 90 * position
    torque += 0.05 * random.standard_normal(len(torque))
    data = np.column_stack([np.arange(len(torque)) / RATE, position, torque])
    with BagWriter(folder / "bag") as writer:
        writer.add_topic("/ankle/samples")
        for first in range(0, len(data), 32):
            writer.write_block("/ankle/samples", Block(COLUMNS, data[first : first + 32]))
    result = estimate_bag(folder / "bag", folder / "estimates")
    write_answer(answer(folder / "bag", result, "simultaneous", ""), folder / "estimates")
    return folder


def study_rows():
    """Results of three subjects with three visits, one of which is doubtful."""
    values = {"K[N.m/rad]": 90.0, "G[N.m.s/rad]": 8.0, "B[N.m.s/rad]": 0.6, "I[kg.m^2]": 0.0137,
              "valid[%]": 98.0, "missing_samples[1]": 12.0, "held_out_vaf[%]": 97.0,
              "mean_torque[N.m]": -3.0, "K_of_mvc[%/rad]": 110.0}  # fmt: skip
    random = np.random.default_rng(2)
    return [
        Row(subject, visit, 1, name, value * random.uniform(0.9, 1.1), 0.05 * value, doubt)
        for subject in ("S01", "S02", "S03")
        for visit, doubt in ((1, 0.0), (2, 0.1), (3, 0.9 if subject == "S03" else 0.0))
        for name, value in values.items()
    ]


def test_the_report_of_a_recording_has_no_words_over_one_another(browser, recording):
    assert problems(browser, recording / "estimates" / "report.html") == {}


@pytest.mark.slow
def test_the_page_of_a_recording_has_no_words_over_one_another(browser, recording):
    bag, estimates = recording / "bag", recording / "estimates"
    page = write_recording_page(bag, recording / "bag.html", None, estimates)
    assert problems(browser, page) == {}


@pytest.mark.slow
def test_the_report_of_a_study_has_no_words_over_one_another(browser, tmp_path):
    failures = {"sub-S04_ses-01_run-01": f"no samples in {LONG_NAME}"}
    page = write_study_report(study_rows(), failures, tmp_path / "report.html", "A study")
    assert problems(browser, page) == {}


def test_words_of_a_report_that_lie_over_one_another_are_found(browser, tmp_path):
    write_diagnosis(tmp_path / "report.html")
    assert problems(browser, tmp_path / "report.html") == {}
    text = (tmp_path / "report.html").read_text()
    moved = text.replace("<ul>", "<ul style='position:absolute;top:0;width:30rem'>")
    (tmp_path / "report.html").write_text(moved)
    found = problems(browser, tmp_path / "report.html")
    assert any("over one another" in one for one in found[1366])
    assert any("beyond the window" in one for one in found[390])
