"""plan.html in a real browser: it shows the part, its controls change what is seen, all can use it.

Skipped where no Chromium with its driver is installed (Debian: chromium chromium-driver).
"""

import base64
import io
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import planner
from planner.plan import Finding

webdriver = pytest.importorskip("selenium.webdriver")

LOADED_S = 10.0
"""A bound for a busy machine without a graphics card; two cores of their own take 1.2 s for the
finger, of the 2 s that are promised."""

PLACE_MM = (30.0, 9.0, 12.0)
Pages = Callable[[str], Path]
Load = Callable[..., float]


@pytest.fixture(scope="module")
def pages(finger_plan: planner.Plan, tmp_path_factory: pytest.TempPathFactory) -> Pages:
    """The finger with nothing found, or with two findings, one of which has a place."""
    thin = Finding("thin-wall", "a wall of 0.3 mm", "FLX9770", PLACE_MM, size_mm=0.3)
    none = Finding("cell", "cells that are too small")
    made: dict[str, Path] = {}
    for name, findings in (("sound", ()), ("found", (none, thin))):
        made[name] = tmp_path_factory.mktemp(name) / "plan.html"
        made[name].write_bytes(planner.plan_page(replace(finger_plan, findings=findings)))
    return made.__getitem__


@pytest.fixture
def load(browser: Any, open_page: Callable[..., None]) -> Load:
    """Open a page and return how long it took, in seconds, until its view was drawn."""

    def loaded(page: Path, **window: Any) -> float:
        open_page(page, **window)
        ready = browser.execute_script("return document.documentElement.dataset.ready")
        assert ready != "without-view"
        seen(browser)  # which waits for the graphics
        return float(browser.execute_script("return performance.now()")) / 1000.0

    return loaded


def seen(browser: Any) -> Any:
    """Return the view's pixels on white, (rows, columns, 3), as a frame drawn now has them."""
    script = "planView.draw(); return document.getElementById('view').toDataURL().slice(22)"
    return pixels_of(base64.b64decode(browser.execute_script(script)))


def pixels_of(png: bytes) -> Any:
    image = Image.open(io.BytesIO(png)).convert("RGBA")
    return np.asarray(Image.alpha_composite(Image.new("RGBA", image.size, "white"), image)).astype(
        int
    )[:, :, :3]


def changed(before: Any, after: Any) -> int:
    """Count pixels that differ by more than the rounding of a colour."""
    return int((np.abs(before - after).max(axis=2) > 8).sum())


def coloured(pixels: Any) -> int:
    """Count pixels that are no shade of grey: the part, not the ground."""
    return int((np.ptp(pixels, axis=2) > 60).sum())


def click(browser: Any, selector: str) -> None:
    browser.execute_script("document.querySelector(arguments[0]).click()", selector)


def camera(browser: Any) -> dict[str, Any]:
    found: dict[str, Any] = browser.execute_script("return planView.camera()")
    return found


def test_the_part_is_there_soon(browser: Any, load: Load, pages: Pages) -> None:
    taken = load(pages("sound"))
    assert taken < LOADED_S
    pixels = pixels_of(browser.find_element("id", "view").screenshot_as_png)
    # The finger fills most of the width and about a fifth of the view.
    assert coloured(pixels) > 0.08 * pixels.shape[0] * pixels.shape[1]
    hues = {tuple(c) for c in (pixels[np.ptp(pixels, axis=2) > 60] // 32).tolist()}
    assert len(hues) > 10  # of ten materials, lit from one side


def test_a_section_is_cut_filled_and_moved(browser: Any, load: Load, pages: Pages) -> None:
    load(pages("sound"))
    whole = seen(browser)
    click(browser, "input[name=section][value=y]")
    cut = seen(browser)
    assert changed(whole, cut) > 3000
    # TangoPlus and FLX9740 as their palette has them: what is cut is filled, and not lit.
    for colour in ((0xFB, 0xD7, 0x24), (0xFD, 0xB1, 0x30)):
        assert (np.abs(cut - colour).max(axis=2) <= 2).sum() > 80
    assert "y = 0.00 mm" in browser.find_element("id", "section-words").text
    slider = browser.find_element("id", "section-place")
    slider.send_keys(webdriver.Keys.PAGE_UP)
    assert changed(cut, seen(browser)) > 500
    click(browser, "#section-flip")
    assert changed(cut, seen(browser)) > 2000
    click(browser, "input[name=section][value=off]")
    assert changed(whole, seen(browser)) == 0


def test_materials_are_switched_off_and_on(
    browser: Any, load: Load, pages: Pages, finger_plan: planner.Plan
) -> None:
    load(pages("sound"))
    whole = seen(browser)
    click(browser, "#materials li:nth-child(7) input")
    assert changed(whole, seen(browser)) > 1500
    click(browser, "#hide-all")
    assert coloured(seen(browser)) == 0
    click(browser, "#show-all")
    assert changed(whole, seen(browser)) == 0
    words = browser.find_element("css selector", "#materials li:nth-child(7)").text
    assert finger_plan.regions[6].printed in words
    assert f"{finger_plan.regions[6].volume_mm3:.0f} mm³" in words


def test_the_figure_points_a_material_out(browser: Any, load: Load, pages: Pages) -> None:
    load(pages("sound"), height=1200)  # so that the view and the figure are seen at once
    whole = seen(browser)
    band = browser.find_element("css selector", "figure g[data-material='3'] .swatch")
    webdriver.ActionChains(browser).move_to_element(band).perform()
    assert changed(whole, seen(browser)) > 5000
    row = browser.find_element("css selector", "tr[data-material='3']")
    assert "lit" in str(row.get_attribute("class"))


def test_a_finding_is_flown_to_from_the_list_and_from_its_mark(
    browser: Any, load: Load, pages: Pages
) -> None:
    load(pages("found"), still=False)
    before = camera(browser)
    click(browser, "#findings button")
    until = time.monotonic() + 10.0  # the flight takes 0.45 s where frames come
    while camera(browser)["zoom"] < 1.5 * before["zoom"] and time.monotonic() < until:
        time.sleep(0.05)
    there = camera(browser)
    assert there["zoom"] > 1.5 * before["zoom"]
    load(pages("found"))
    click(browser, ".mark")
    there = camera(browser)
    assert there["target"] == pytest.approx(PLACE_MM, abs=1e-6)
    pressed = browser.find_element("css selector", "#findings button")
    assert pressed.get_attribute("aria-pressed") == "true"


def test_keys_turn_move_zoom_and_reset(browser: Any, load: Load, pages: Pages) -> None:
    load(pages("sound"))
    start = camera(browser)
    view = browser.find_element("id", "view")
    keys = webdriver.Keys
    view.send_keys(keys.ARROW_LEFT)
    turned = camera(browser)
    assert turned["position"] != pytest.approx(start["position"])
    assert turned["target"] == pytest.approx(start["target"])
    view.send_keys(keys.ARROW_UP, "+", "+", "-", keys.SHIFT + keys.ARROW_RIGHT)
    moved = camera(browser)
    assert moved["zoom"] > start["zoom"]
    assert moved["target"] != pytest.approx(start["target"])
    view.send_keys("0")
    back = camera(browser)
    assert back["position"] == pytest.approx(start["position"])
    assert back["zoom"] == pytest.approx(start["zoom"])


def test_dragging_turns_and_the_pointer_reads_the_material(
    browser: Any, load: Load, pages: Pages
) -> None:
    load(pages("sound"))
    view = browser.find_element("id", "view")
    webdriver.ActionChains(browser).move_to_element(view).perform()
    until = time.monotonic() + 10.0
    while not (words := browser.find_element("id", "under").text) and time.monotonic() < until:
        time.sleep(0.05)
    assert " mm" in words
    assert any(name in words for name in ("FLX9770", "FLX9785", "FLX9795"))
    before = seen(browser)
    drag = webdriver.ActionChains(browser).click_and_hold(view).move_by_offset(120, 40)
    drag.release().perform()
    assert changed(before, seen(browser)) > 2000


@pytest.mark.parametrize(("dark", "width"), [(False, 1000), (True, 1000), (False, 380)])
def test_light_dark_and_narrow_are_for_all(
    browser: Any, load: Load, pages: Pages, for_all: Callable[[], None], dark: bool, width: int
) -> None:
    load(pages("found"), dark=dark, width=width)
    ground = browser.execute_script("return getComputedStyle(document.body).backgroundColor")
    assert (max(int(v) for v in ground.strip("rgb()").split(",")) < 50) == dark
    click(browser, "#findings button")
    for_all()


def test_without_3d_the_rest_stands(browser: Any, pages: Pages) -> None:
    page = pages("sound")
    hidden = page.with_name("without.html")
    # The first script of the page to run takes WebGL away, as a browser without it does.
    text = page.read_text(encoding="utf-8")
    start = text.index('<meta http-equiv="Content-Security-Policy"')
    text = text[:start] + text[text.index(">", start) + 1 :]
    off = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
    hidden.write_text(text.replace("<body>", f"<body>{off}"), encoding="utf-8")
    browser.get(hidden.as_uri())
    assert browser.find_element("id", "no-view").is_displayed()
    assert not browser.find_element("id", "section").is_displayed()
    assert "VeroWhitePlus" in browser.find_element("css selector", "#figures table").text
    name = browser.find_element("css selector", "#materials .name")
    assert name.size["width"] > 60
    assert name.size["height"] < 30  # TangoPlus, in one line
    browser.get_log("browser")  # three.js says that there is no WebGL


def test_nothing_of_a_hostile_name_runs(
    browser: Any, load: Load, samples: Path, tmp_path: Path
) -> None:
    part = tmp_path / "a<img src=x onerror=alert(1)>.stl"
    part.write_bytes((samples / "dogbone.stl").read_bytes())
    hostile = planner.grade(part, from_="Tango", to="FLX9795", bands=2)
    page = tmp_path / "plan.html"
    page.write_bytes(planner.plan_page(hostile))
    load(page)
    assert browser.find_element("css selector", "h1").text == part.name
    assert browser.find_elements("css selector", "img") == []
