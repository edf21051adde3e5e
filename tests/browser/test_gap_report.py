"""report.html in a real browser: marks tell what they are, figures open large, all can use it."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from planner.gap.diagnosis import Diagnosis, Gap, Hypothesis, Location, Traces
from planner.report.gap_page import diagnosis_files

Open = Callable[..., None]


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two warm specimens, and a cold one that the palette predicts half as stiff as it is."""
    travel = np.linspace(0.0, 10.0, 11)
    traces = Traces(
        label=("soft, 40 °C", "soft, 23 °C"),
        rows=[[0, 1], [2]],
        travel_mm=np.stack([travel, travel]),
        time_s=np.stack([travel, travel]),
        before_N=np.stack([travel, travel]),
        after_N=np.stack([travel, 2.0 * travel]),
        measured_N=np.stack([travel, 1.1 * travel, 2.0 * travel]),
        residual_before=np.array([0.0, 0.05, 0.3]),
        residual_after=np.array([0.0, 0.05, 0.0]),
        peaks_N=np.array([[10.5], [10.5], [20.0]]),
        columns={
            "specimen": ("A", "B", "C"),
            "material": ("soft",) * 3,
            "temperature_C": (40.0, 40.0, 23.0),
        },
    )
    diagnosis = Diagnosis(
        campaign="warm <b>", palette="lab", palette_sha256="ab" * 32, specimens=3, tests=2,
        verdict="temperature", ranking=(Hypothesis(("temperature",), 0.9),),
        same_class=(("temperature",),), not_testable=(),
        where=(Location("temperature_C", 0.8, (0.7, 0.9), 0.001, "force 50 % above prediction"),),
        gap=Gap(0.2, 0.03, 0.03, 1.0, (0.9, 1.0), 0.16, 0.04, "leave one condition out"),
        effect=(), remainder=(), data_quality=(), next_experiments=(), detectable=(),
        limitations=(), traces=traces,
    )  # fmt: skip
    file = tmp_path_factory.mktemp("gap") / "report.html"
    file.write_bytes(diagnosis_files(diagnosis)["report.html"])
    return file


def told(browser: Any) -> str:
    return str(browser.find_element("css selector", ".tip").text)


def test_the_pointer_and_the_arrows_read_a_mark(
    browser: Any, open_page: Open, report: Path
) -> None:
    webdriver = pytest.importorskip("selenium.webdriver")
    open_page(report, height=1400)
    dots = "figure:first-of-type g[data-told] circle:nth-last-child(1)"
    dot = browser.find_element("css selector", dots)
    webdriver.ActionChains(browser).move_to_element(dot).perform()
    assert told(browser).startswith("measured, C: soft, temperature 23 °C; error 30")
    assert told(browser).endswith("travel 10 mm, force 20 N")
    webdriver.ActionChains(browser).move_to_element(
        browser.find_element("tag name", "h1")
    ).perform()
    assert told(browser) == ""
    residuals = browser.find_elements("css selector", "figure .wide")[2]
    residuals.send_keys(webdriver.Keys.ARROW_RIGHT, webdriver.Keys.ARROW_RIGHT)
    assert told(browser).startswith("B: soft, temperature 40 °C; error 5.0")
    residuals.send_keys(webdriver.Keys.ESCAPE)
    assert told(browser) == ""


def test_a_figure_opens_large_and_zooms(browser: Any, open_page: Open, report: Path) -> None:
    keys = pytest.importorskip("selenium.webdriver").Keys
    open_page(report)
    home = browser.find_element("css selector", "figure .wide")
    home.send_keys(keys.ENTER)

    def box() -> list[float]:
        words = browser.execute_script(
            "return document.querySelector('.sheet svg').getAttribute('viewBox')"
        )
        return [float(word) for word in words.split()]

    whole = box()
    sheet = browser.find_element("css selector", ".sheet")
    sheet.send_keys("+", "+")
    near = box()
    assert near[2] == pytest.approx(whole[2] / 1.4**2, abs=0.01)
    sheet.send_keys(keys.SHIFT + keys.ARROW_RIGHT)
    assert box()[0] == pytest.approx(near[0] + 0.1 * near[2], abs=0.01)
    sheet.send_keys(keys.SHIFT + keys.NULL + "0")
    assert box() == whole
    wheel = "new WheelEvent('wheel', {deltaY: -300})"
    scroll = f"document.querySelector('.sheet').dispatchEvent({wheel})"
    browser.execute_script(scroll)
    assert box()[2] == pytest.approx(whole[2] / 2.0, abs=0.01)
    sheet.send_keys(keys.ESCAPE)
    until = time.monotonic() + 10.0  # the browser tells of the end in a moment of its own
    while not home.find_elements("css selector", "svg") and time.monotonic() < until:
        time.sleep(0.02)
    assert home.find_element("css selector", "svg").is_displayed()
    assert browser.switch_to.active_element == home


@pytest.mark.parametrize(("dark", "width"), [(False, 1200), (True, 1200), (False, 380)])
def test_light_dark_and_narrow_are_for_all(
    browser: Any, open_page: Open, for_all: Callable[[], None], report: Path, dark: bool, width: int
) -> None:
    open_page(report, dark=dark, width=width)
    for_all()
    assert browser.find_elements("css selector", "h1 b") == []


def test_dragging_moves_a_large_figure_and_a_click_reads_a_mark(
    browser: Any, open_page: Open, report: Path
) -> None:
    webdriver = pytest.importorskip("selenium.webdriver")
    open_page(report, width=380, height=800)
    browser.find_element("css selector", ".enlarge").click()
    box = "return document.querySelector('.sheet svg').getAttribute('viewBox')"
    width, height = map(float, browser.execute_script(box).split()[2:])
    assert height > width  # in the shape of the window
    browser.find_element("css selector", ".sheet").send_keys("+", "+", "+")
    before = browser.execute_script(box)
    sheet = browser.find_element("css selector", ".sheet")
    drag = webdriver.ActionChains(browser).click_and_hold(sheet).move_by_offset(30, 20)
    drag.release().perform()
    assert browser.execute_script(box) != before
    browser.find_element("css selector", ".sheet").send_keys("0")
    dot = browser.find_element("css selector", ".sheet g[data-told] circle")
    webdriver.ActionChains(browser).click(dot).perform()
    assert told(browser).startswith("measured, ")
