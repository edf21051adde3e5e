"""Make plan-page.png: plan.html of the sample finger, cut open, as Chromium draws it.

python docs/images/make_page.py

Needs Chromium with its driver, and the packages of the extra `test`.
"""

import base64
import io
import shutil
import tempfile
from pathlib import Path

from PIL import Image
from selenium import webdriver

import planner

HERE = Path(__file__).resolve().parent
WIDTH, HEIGHT = 1200, 800
ARGUMENTS = (
    "--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars",
    "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip


def shot_of(page: bytes, script: str) -> Image.Image:
    """Open a page, run a script in it, and return what is seen."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ARGUMENTS:
        options.add_argument(argument)
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    browser = webdriver.Chrome(options=options, service=service)
    size = {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False}
    try:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "page.html"
            file.write_bytes(page)
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            browser.get(file.as_uri())
            browser.execute_script(script)
            browser.execute_async_script(
                "requestAnimationFrame(() => setTimeout(arguments[0], 500))"
            )
            shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
    finally:
        browser.quit()
    return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")


def main() -> None:
    """Grade the finger, open its page, cut it along y, and keep what is seen."""
    plan = planner.grade(
        HERE.parents[1] / "samples" / "finger.stl", from_="Tango", to="Vero", axis="x"
    )
    cut = "document.querySelector('input[value=y]').click()"
    picture = shot_of(planner.plan_page(plan), cut).quantize(128, dither=Image.Dither.NONE)
    picture.save(HERE / "plan-page.png", optimize=True)


if __name__ == "__main__":
    main()
