"""Reports fit a phone: nothing is cut, and what is wide scrolls by itself."""

import pytest

from model_discrepancy.report.html_report import html_list, html_table, write_page
from session_analysis import html_page

pytestmark = [pytest.mark.live, pytest.mark.untimed]

PHONE = {"width": 390, "height": 800}
HEAD = ["effect", "in a model without it", "in the whole model", "what was recorded with it"]
ROW = ["short_range_stiffness_of_the_plantarflexors", "K = 97.8 N.m/rad", "65.5 +- 6.3", "yes"]
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
