"""A scripted session through everything: pages, simulated subject, recorder, report; with
screenshots where there is a browser.
"""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.errors import RunError
from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from biofeedback.errors import SessionError
from biofeedback.session.scripted_session import ScriptedSession
from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser
from session_analysis.console import report_validation
from session_analysis.errors import AnalysisError

if TYPE_CHECKING:
    from playwright.async_api import Page

LONGEST_SESSION = 420.0  # s; the session lasts 150 s on an idle machine
SCREENSHOT_AT = ("hold", 2)  # the hold at -5 N.m
SETTLING_TIME = 3.0  # s in front before a page is photographed


def run_session(out: Path, logs: Path, console: Console) -> tuple[dict, str, str]:
    """Lead the demonstration protocol from arm to report.

    Parameters
    ----------
    out
        New folder; gets ``bag``, ``report``, ``subject.png``, ``operator.png``.
    logs
        Folder for one log file a node.
    console
        Where progress is shown.

    Returns
    -------
    tuple[dict, str, str]
        The last state that the pages showed; what became of the screenshots, in words; why there is
        no report, empty where there is one.

    Raises
    ------
    RunError
        A node failed, or the session did not come to its end.
    """
    out.mkdir(parents=True)
    port = free_port()
    graph = load_graph("simulated_session").with_settings(
        [
            f"record.out={out / 'bag'}",
            f"biofeedback.port={port}",
            f"biofeedback.state_file={out / 'progress.json'}",
            "biofeedback.protocol=demonstration",
        ]
    )
    url = f"http://127.0.0.1:{port}"
    console.print(
        f"Six processes and the pages at {url}/ and {url}/operator; the simulated subject follows "
        "the target."
    )
    with Processes(graph, logs) as processes:
        wait_until_served(port, processes)
        state, pictures = asyncio.run(_lead(url, out, console))
        codes = processes.stop()
    failed = {name: code for name, code in codes.items() if code}
    if failed:
        raise RunError(f"exit codes {failed} (logs: {logs})")
    try:
        report_validation(
            [f"simulated subject={out / 'bag'}"], out / "report", False, None, console
        )
    except AnalysisError as error:
        return state, pictures, str(error)
    return state, pictures, ""


async def _lead(url: str, out: Path, console: Console) -> tuple[dict, str]:
    """Return the session, and two pages in a browser beside it."""
    async with AsyncExitStack() as stack:
        pages = {}
        path = find_browser()
        if path is None:
            pictures = f"not made: {NO_BROWSER}"
        else:
            from playwright.async_api import async_playwright

            driver = await stack.enter_async_context(async_playwright())
            browser = await driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
            stack.push_async_callback(browser.close)
            for name, address in (("subject", "/"), ("operator", "/operator")):
                pages[name] = await browser.new_page(
                    viewport={"width": 1600, "height": 900 if name == "subject" else 950}
                )
                await pages[name].goto(url + address)
            pictures = "subject.png, operator.png"

        taking: list[asyncio.Task] = []

        async def take_pictures(kind: str, hold: int) -> None:
            # Beside the session: a browser that is slow must not keep the subject waiting.
            if (kind, hold) == SCREENSHOT_AT:
                taking.append(asyncio.create_task(_photograph(pages, out)))

        session = ScriptedSession(
            url, take_pictures, lambda sentence: console.print(f"  {sentence}")
        )
        try:
            state = await session.run(LONGEST_SESSION)
        except (asyncio.TimeoutError, SessionError) as error:
            raise RunError(
                "the session did not come to its end: "
                f"{error or f'longer than {LONGEST_SESSION:g} s'}"
            ) from None
        failed = [
            str(found).splitlines()[0]
            for found in await asyncio.gather(*taking, return_exceptions=True)
            if isinstance(found, Exception)
        ]
        return state, f"not made: {failed[0]}" if failed else pictures


async def _photograph(pages: dict[str, Page], out: Path) -> None:
    """Photograph one page after the other: a browser hardly serves one that is not in front."""
    for name, page in pages.items():
        await page.bring_to_front()
        await page.wait_for_timeout(1000.0 * SETTLING_TIME)
        await page.screenshot(path=out / f"{name}.png")


def hold_shares(log: list[dict]) -> str:
    """Return the share of the time in the target, for each hold in the pages' log."""
    ended = [entry["details"] for entry in log if entry["event"] == "hold ended"]
    return (
        ", ".join(
            f"hold {details['hold']}: {details.get('in_target[%]', 0.0):.0f} %" for details in ended
        )
        or "no hold"
    )
