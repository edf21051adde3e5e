"""A real browser for pages; tests that want it are skipped where there is none with its driver.

Debian has it in the packages chromium and chromium-driver.
"""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--disable-quic", "--hide-scrollbars", "--use-gl=angle", "--use-angle=swiftshader",
    # Only the view needs a graphics card: one that is made up takes thrice as long for the rest.
    "--enable-unsafe-swiftshader", "--disable-gpu-rasterization", "--disable-gpu-compositing",
)  # fmt: skip
READ_BACK = "GPU stall due to ReadPixels"
"""What such a Chromium says of its own frames. A page that asks for pixels is told apart."""
ASKED = """
for (const kind of [WebGLRenderingContext, WebGL2RenderingContext]) {
    const own = kind.prototype.readPixels;
    kind.prototype.readPixels = function (...all) {
        console.error("the page reads pixels");
        return own.apply(this, all);
    };
}
"""
Open = Callable[..., None]


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    webdriver = pytest.importorskip("selenium.webdriver")
    names = ("chromium", "chromium-browser", "google-chrome")
    chromium, driver_file = next(filter(None, map(shutil.which, names)), ""), "chromedriver"
    if not (chromium and shutil.which(driver_file)):
        pytest.skip("no Chromium with its driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    profile = f"--user-data-dir={tmp_path_factory.mktemp('profile')}"
    for argument in (*ARGUMENTS, profile):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(shutil.which(driver_file))
    driver = webdriver.Chrome(options=options, service=service)
    driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": ASKED})
    yield driver
    driver.quit()


@pytest.fixture(autouse=True)
def nothing_to_complain_of(browser: Any) -> Iterator[None]:
    """Whatever a test does, the console stays empty."""
    yield
    said = [entry["message"] for entry in browser.get_log("browser")]
    assert [words for words in said if READ_BACK not in words] == []


@pytest.fixture
def open_page(browser: Any) -> Open:
    """Open a page in a window of a size, light or dark, with or without motion."""

    def opened(
        page: Path, *, dark: bool = False, still: bool = True, width: int = 1000, height: int = 600
    ) -> None:
        features = {
            "prefers-color-scheme": "dark" if dark else "light",
            "prefers-reduced-motion": "reduce" if still else "no-preference",
        }
        wanted = [{"name": name, "value": value} for name, value in features.items()]
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": wanted})
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get(page.as_uri())

    return opened


@pytest.fixture
def for_all(browser: Any) -> Callable[[], None]:
    """Hold the page that is open to axe's rules, and to the width of its window."""
    axe = pytest.importorskip("axe_core_python.base")

    def hold() -> None:
        script = Path(axe.__file__).with_name("axe.min.js").read_text(encoding="utf-8")
        found = browser.execute_async_script(script + "\naxe.run().then(arguments[0])")
        serious = [
            (fault["id"], [node["target"] for node in fault["nodes"]])
            for fault in found["violations"]
            if fault["impact"] in ("serious", "critical")
        ]
        assert serious == []
        assert len(found["passes"]) > 15
        overflow = "return document.documentElement.scrollWidth - innerWidth"
        assert browser.execute_script(overflow) <= 0

    return hold
