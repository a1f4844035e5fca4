"""The page in a real browser: Debian's Chromium, driven by Playwright."""

import shutil
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from eval.play.serving import close_server, open_server
from eval.play.session import Session
from eval.play.stage import Stage

CHROMIUM = shutil.which("chromium")
pytest.importorskip("viser", reason="the live page is not installed: make play")
pytest.importorskip("playwright", reason="Playwright is not installed: make play")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None, reason="no browser. On Debian, as root: apt-get install chromium"
    ),
]

FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-sync "
    "--disable-background-networking --disable-component-update "
    "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
).split()
PATIENCE = 90.0  # s; the browser draws in software


class Live:
    """A session that is served, and a browser to look at it."""

    def __init__(self, browser: Any, server: Any, session: Session) -> None:
        self.browser, self.session = browser, session
        self.address = f"http://{server.get_host()}:{server.get_port()}"

    def open(self, link: str = "", width: int = 560, height: int = 420) -> Any:
        """What an address shows, in a window of its own."""
        page = self.browser.new_page(viewport={"width": width, "height": height})
        page.set_default_timeout(1000 * PATIENCE)
        page.goto(self.address + link, wait_until="domcontentloaded")
        return page

    def view(self, link: str = "", width: int = 560, height: int = 420) -> Any:
        """A viewer of the page."""
        page = self.open(link, width, height)
        page.get_by_text("action layer").wait_for()
        return page

    def until(self, page: Any, true: Callable[[], bool]) -> None:
        """Wait for the session."""
        end = time.monotonic() + PATIENCE
        while not true():
            assert time.monotonic() < end, "it did not happen"
            page.wait_for_timeout(100)


@pytest.fixture
def live():
    from playwright.sync_api import sync_playwright

    from eval.play.page import Page

    stage = Stage.of("fbid_gym/QuadrupedWalk-v0", {"action_layer": "base_acceleration"}, {})
    # Paused, so that a slow browser has nothing to draw but what the test does.
    session = Session(stage, {"paused": True, "ahead": 0.0})
    server = open_server(session, "127.0.0.1", 0)
    page = Page(server, session)
    loop = threading.Thread(target=page.run)
    loop.start()
    try:
        with sync_playwright() as driver:
            browser = driver.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
            yield Live(browser, server, session)
            browser.close()
    finally:
        page.stop()
        loop.join()
        close_server(server)


def press(page: Any, words: str) -> None:
    # Not `click`, which waits for a page that stands still.
    page.get_by_text(words, exact=True).first.dispatch_event("click")


def number(page: Any, label: str) -> Any:
    """The box beside a slider."""
    row = page.locator(f"xpath=//label[normalize-space()='{label}']/ancestor::*[.//input][1]")
    return row.locator("input:not([type=hidden])").last


def test_a_viewer_pushes_steers_and_switches_and_another_sees_it(live):
    session, page = live.session, live.view()
    first = session.lanes[0].qpos

    # A push moves the robot.
    version = session.version
    press(page, "left")
    live.until(page, lambda: session.version > version)
    press(page, "one step")
    live.until(page, lambda: session.steps == 1)
    force = session.lanes[0].push_force.copy()
    assert np.linalg.norm(force) == pytest.approx(50.0, abs=1.0)
    for done in range(2, 10):
        press(page, "one step")
        live.until(page, lambda done=done: session.steps == done)
    pushed = session.lanes[0].qpos - first
    assert pushed[:2] @ force[:2] > 0.005 * np.linalg.norm(force)

    # A slider acts.
    box = number(page, "forward (m/s)")
    box.fill("0.5", force=True)
    box.press("Enter")
    live.until(page, lambda: session.settings["ahead"] == 0.5)

    # Another layer gives other torques, from the same state.
    state = session.lanes[0].state()
    menu = page.locator("xpath=//label[normalize-space()='action layer']/following::input[1]")
    menu.scroll_into_view_if_needed()  # its choices open only where it is seen
    menu.dispatch_event("click")
    page.get_by_role("option", name="torque", exact=True).dispatch_event("click")
    live.until(page, lambda: session.settings["layer"] == "torque")
    assert np.array_equal(session.lanes[0].state()["simulation.qpos"], state["simulation.qpos"])
    press(page, "one step")
    live.until(page, lambda: session.steps == 10)
    assert not np.allclose(session.lanes[0].last.info["torque"], state["torque"], atol=0.1)

    # A second viewer sees the same; the session goes on when the first leaves.
    second = live.view()
    assert float(number(second, "forward (m/s)").input_value()) == 0.5
    page.close()
    press(second, "one step")
    live.until(second, lambda: session.steps == 11)


def test_a_robot_is_pushed_by_dragging_it(live):
    session, page = live.session, live.view("/?paused=true", 900, 420)
    place = page.locator("canvas").first.bounding_box()
    x, y = place["x"] + 0.5 * place["width"], place["y"] + 0.5 * place["height"]

    def pushed() -> np.ndarray:
        return session.lanes[0].state()["plan.push_force"][0, 0]

    def drag() -> bool:
        page.mouse.move(x, y)
        page.mouse.down()
        for step in range(1, 6):
            page.mouse.move(x + 10 * step, y, steps=2)
            page.wait_for_timeout(500)
        return bool(pushed().any())

    live.until(page, lambda: drag() or page.mouse.up())  # until the robot is drawn
    # The camera looks along (-1.6, 1.9): to its right is (1.9, 1.6).
    assert pushed()[:2] @ [1.9, 1.6] > 0.9 * np.hypot(1.9, 1.6) * np.linalg.norm(pushed()) > 1.0
    page.mouse.up()
    live.until(page, lambda: not pushed().any())
