"""Measures reports in a real browser at four widths, and takes the pictures of the documentation.

Example, with a report that ``ankle estimate`` wrote::

    .venv/bin/python test/report_pictures.py report_estimate=session_estimates/report.html

writes ``docs/report_estimate.png`` and ``docs/report_estimate_390.png``.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
CHECK = (ROOT / "src/biofeedback/test/layout_check.js").read_text()
"""Finds words over one another, cut words and words beyond the window."""
SIZES = ((1920, 1080), (1366, 768), (820, 1180), (390, 844))
SHOWN_WIDTHS = (1366, 390)
PICTURE_HEIGHTS = {1366: 1000, 390: 1100}
"""[pixels] What a picture of the documentation shows of a report, from its top on."""
PATIENCE = 180_000
"""[ms] For a page of ten megabytes on a busy computer."""
COME_TO_REST = """() => new Promise(done => requestAnimationFrame(() => setTimeout(done, 500)))"""


def open_report(browser, path, width, height):
    """Open a report in a window of a size, and wait until its figures are drawn."""
    page = browser.new_page(viewport={"width": width, "height": height}, device_scale_factor=1)
    page.set_default_timeout(PATIENCE)
    page.goto(Path(path).resolve().as_uri())
    page.wait_for_function(
        "[...document.querySelectorAll('.js-plotly-plot')].every(one => one._fullLayout)"
    )
    page.evaluate(COME_TO_REST)
    return page


def problems(browser, path):
    """Return what is wrong with the layout of a report, by width; empty where nothing is."""
    wrong = {}
    for width, height in SIZES:
        page = open_report(browser, path, width, height)
        if found := page.evaluate(CHECK):
            wrong[width] = found
        page.close()
    return wrong


def take_pictures(browser, path, name, folder):
    """Write the pictures of a report for the documentation."""
    for width in SHOWN_WIDTHS:
        page = open_report(browser, path, width, PICTURE_HEIGHTS[width])
        ending = "" if width == SHOWN_WIDTHS[0] else f"_{width}"
        page.screenshot(path=folder / f"{name}{ending}.png")
        page.close()


def main(arguments):
    from playwright.sync_api import sync_playwright

    from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser

    path = find_browser()
    if path is None:
        return NO_BROWSER
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        wrong = {}
        for argument in arguments:
            name, _, report = argument.partition("=")
            take_pictures(browser, report, name, ROOT / "docs")
            wrong |= {f"{name} at {k} px": v for k, v in problems(browser, report).items()}
        browser.close()
    return "\n".join(f"{where}: {', '.join(found)}" for where, found in wrong.items())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]) or 0)
