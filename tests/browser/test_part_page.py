"""The page of a loaded part in a real browser: steps by keyboard, colours, section, dark mode."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import planner
from benchmarks.interfaces import BOX, FACES

pytest.importorskip("selenium")


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    bent = planner.simulate(
        ([30.0, 4.0, 4.0] * BOX, FACES), material="Tango", fix="x=min",
        load="x=max: 0,0,-0.04 N", cell_mm=4.0, steps=4, compare_cells=False,
    )  # fmt: skip
    file = tmp_path_factory.mktemp("pages") / "bent.html"
    file.write_bytes(planner.part_page(bent))
    return file


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_the_slider_takes_the_part_from_step_to_step(
    page: Path, dark: bool, browser: Any, open_page: Callable[..., None], for_all: Any
) -> None:
    open_page(page, dark=dark)
    slider, words = (browser.find_element("id", name) for name in ("step", "step-words"))
    assert words.text.startswith("load 1: ")
    for_all()
    # Low in the box of all steps there is the bent tip, and nothing of the part at rest.
    low = (
        "const d = JSON.parse(document.querySelector('#data').textContent);"
        "planView.setView('front'); planView.draw();"
        "return [...Array(60).keys()].some((i) => planView.pick(...planView.project("
        "[d.origin[0] + (i * d.size[0]) / 60, -5, d.origin[2] + 1])))"
    )
    assert browser.execute_script(low)
    slider.send_keys("\ue011")  # Home
    assert words.text == "load 0: 0 mm"
    assert slider.get_attribute("aria-valuetext") == words.text
    assert not browser.execute_script(low)
    assert browser.find_element("css selector", "tr.lit").get_attribute("data-step") == "0"
    slider.send_keys("\ue014")  # right
    assert words.text.startswith("load 0.25: ")


@pytest.mark.slow
def test_the_value_under_the_pointer_the_outline_and_a_section(
    page: Path, browser: Any, open_page: Callable[..., None]
) -> None:
    open_page(page)
    told = (
        "const d = JSON.parse(document.querySelector('#data').textContent);"
        "planView.setView('front'); planView.draw();"
        "const at = planView.project([d.origin[0] + 2, -5, d.origin[2] + d.size[2] - 2]);"
        "return planView.describe(planView.pick(...at))"
    )
    assert browser.execute_script(told).startswith("strain / break 0.")
    browser.find_element("id", "ghost").click()
    browser.find_element("css selector", "input[value=y]").click()
    assert browser.execute_script(told).startswith("inside, at (")


@pytest.mark.slow
@pytest.mark.parametrize(("height", "lines"), [(0, 0), (1000, 1)])
def test_a_flat_face_folded_on_itself_has_no_edge_there(
    page: Path, browser: Any, open_page: Callable[..., None], height: int, lines: int
) -> None:
    """Thinning a surface for display may turn a triangle over in its own plane."""
    open_page(page)
    # Two triangles on one side of the edge that they share; raised, one stands on the other.
    points = [0, 0, 0, 1000, 0, 0, 0, 1000, 0, 1000, 1000 - height, height]
    found = browser.execute_script(
        "return shade({points: Uint16Array.from(arguments[0]), "
        "faces: Uint16Array.from([0, 1, 2, 1, 0, 3])}).edges.length / 2",
        points,
    )
    assert found == lines
