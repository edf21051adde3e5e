"""compare.html in a real browser: both parts are there, and are turned and cut as one."""

import base64
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import planner

Open = Callable[..., None]


@pytest.fixture(scope="module")
def page(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    plans = [
        planner.grade(samples / "dogbone.stl", from_="FLX9740", to=to, bands=3)
        for to in ("FLX9770", "FLX9795")
    ]
    file = tmp_path_factory.mktemp("compare") / "compare.html"
    file.write_bytes(planner.compare_page(*plans))
    return file


def seen(browser: Any, side: int) -> Any:
    """Return a view's pixels, (rows, columns, 4), as a frame drawn now has them."""
    script = (
        "planViews[arguments[0]].draw();"
        "return document.querySelectorAll('canvas')[arguments[0]].toDataURL().slice(22)"
    )
    png = base64.b64decode(browser.execute_script(script, side))
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGBA")).astype(int)


def looks(browser: Any) -> Any:
    return browser.execute_script("return planViews.map((viewer) => viewer.look())")


@pytest.mark.slow
def test_both_views_show_and_move_as_one(browser: Any, open_page: Open, page: Path) -> None:
    keys = pytest.importorskip("selenium.webdriver").Keys
    open_page(page)
    whole = [seen(browser, side) for side in (0, 1)]
    for pixels in whole:
        assert (pixels[:, :, 3] > 200).mean() > 0.02  # a slender part, seen from a corner
    assert (whole[0] != whole[1]).any()
    for side in ("A", "B"):
        before = looks(browser)[0]
        browser.find_element("id", f"view-{side}").send_keys(keys.ARROW_LEFT, "+")
        for number in (0, 1):
            seen(browser, number)  # a frame, which takes the other along
        first, second = looks(browser)
        assert first["mmPerPixel"] < 0.9 * before["mmPerPixel"]
        assert first["direction"] != pytest.approx(before["direction"], abs=0.05)
        for key in first:
            assert second[key] == pytest.approx(first[key], rel=1e-5, abs=1e-6)


@pytest.mark.slow
def test_one_section_and_one_list_for_both(browser: Any, open_page: Open, page: Path) -> None:
    open_page(page)
    whole = [seen(browser, side) for side in (0, 1)]
    click = "document.querySelector(arguments[0]).click()"
    browser.execute_script(click, "input[name=section][value=x]")
    cut = [seen(browser, side) for side in (0, 1)]
    assert " mm" in browser.find_element("id", "section-words").text
    browser.execute_script(click, "input[name=section][value=off]")
    browser.execute_script(click, "#materials li[data-material='1'] input")
    off = [seen(browser, side) for side in (0, 1)]
    for side in (0, 1):
        assert (whole[side] != cut[side]).any(axis=2).sum() > 500
    assert any((whole[side] != off[side]).any() for side in (0, 1))


@pytest.mark.long
@pytest.mark.parametrize(("dark", "width"), [(False, 1200), (True, 380)])
def test_light_dark_and_narrow_are_for_all(
    browser: Any, open_page: Open, for_all: Callable[[], None], page: Path, dark: bool, width: int
) -> None:
    open_page(page, dark=dark, width=width)
    for_all()
