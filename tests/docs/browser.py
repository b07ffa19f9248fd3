"""A headless Chromium that says what a reader would see: errors, missing pictures, overflow, faint text."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
)
BROWSERS = ("chromium", "chromium-browser", "google-chrome")

# Contrast by WCAG 2: text against the nearest backgrounds behind it, blended where they are translucent.
FAINT_TEXT = """
const least = arguments[0];
const parse = c => {
  const m = c.match(/[\\d.]+/g).map(Number);
  const scale = c.startsWith('color(') ? 255 : 1;
  return [m[0] * scale, m[1] * scale, m[2] * scale, m.length > 3 ? m[3] : 1];
};
const over = (a, b) => [0, 1, 2].map(i => a[i] * a[3] + b[i] * (1 - a[3])).concat(1);
const luminance = c => [0.2126, 0.7152, 0.0722].reduce((sum, w, i) => {
  const v = c[i] / 255;
  return sum + w * (v <= 0.03928 ? v / 12.92 : Math.pow((v + 0.055) / 1.055, 2.4));
}, 0);
const dark = matchMedia('(prefers-color-scheme: dark)').matches;
const behind = element => {
  const layers = [];
  for (let e = element; e; e = e.parentElement) {
    const colour = parse(getComputedStyle(e).backgroundColor);
    if (colour[3] > 0) layers.push(colour);
    if (colour[3] === 1) break;
  }
  let below = dark ? [18, 18, 18, 1] : [255, 255, 255, 1];
  for (const layer of layers.reverse()) below = over(layer, below);
  return below;
};
const found = [];
const root = document.querySelector('article') || document.body;
const walker = document.createTreeWalker(root, NodeFilter.SHOW_TEXT);
while (walker.nextNode()) {
  const text = walker.currentNode.textContent.trim(), element = walker.currentNode.parentElement;
  if (!text || !element.getClientRects().length || element.closest('script, style, svg, .headerlink')) continue;
  const style = getComputedStyle(element), ground = behind(element);
  const a = luminance(over(parse(style.color), ground)), b = luminance(ground);
  const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
  if (ratio < least) found.push(`${ratio.toFixed(2)} ${element.tagName}.${element.className}: ${text.slice(0, 40)}`);
}
return found;
"""
BROKEN_PICTURES = """
return [...document.images].filter(i => !i.complete || i.naturalWidth === 0).map(i => i.getAttribute('src').slice(0, 80));
"""
OVERFLOW = """
const width = document.documentElement.clientWidth;
if (document.documentElement.scrollWidth <= width) return [];
const wide = [...document.querySelectorAll('body *')].filter(e => e.getBoundingClientRect().right > width + 1);
return wide.slice(-3).map(e => `${e.tagName}.${e.className} to ${Math.round(e.getBoundingClientRect().right)}`);
"""


class Browser:
    """Opens pages from the file system at a width and in a colour scheme."""

    def __init__(self, driver: Any) -> None:
        self._driver = driver

    def open(self, page: Path, *, width: int, dark: bool, height: int = 900) -> None:
        """Load a page and wait for its pictures."""
        driver = self._driver
        driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
        driver.get_log("browser")  # forget the page before
        driver.get(page.as_uri())
        driver.execute_async_script(
            "const done = arguments[0];"
            "Promise.all([...document.images].map(i => i.decode().catch(() => 0))).then(() => setTimeout(done, 50));"
        )

    def complaints(self) -> list[str]:
        """What the page wrote to the console as an error or a warning."""
        return [
            entry["message"]
            for entry in self._driver.get_log("browser")
            if entry["level"] != "INFO"
        ]

    def broken_pictures(self) -> list[str]:
        """Pictures that did not load."""
        return self._driver.execute_script(BROKEN_PICTURES)

    def pictures(self) -> int:
        """How many pictures the page has."""
        return self._driver.execute_script("return document.images.length")

    def overflow(self) -> list[str]:
        """Elements that make the page wider than the window."""
        return self._driver.execute_script(OVERFLOW)

    def faint_text(self, least: float) -> list[str]:
        """Texts whose contrast against their background is less."""
        return self._driver.execute_script(FAINT_TEXT, least)

    def background(self) -> str:
        """The colour behind the page's text."""
        return self._driver.execute_script("return getComputedStyle(document.body).backgroundColor")

    def screenshot(self, path: Path) -> None:
        """Save what the window shows."""
        self._driver.save_screenshot(str(path))


@contextmanager
def browser(profile: Path) -> Iterator[Browser]:
    """A browser with an empty profile; the test is skipped, with the reason, where there is none."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs the extra docs (selenium)")
    binary = next(filter(None, map(shutil.which, BROWSERS)), None)
    driver_path = shutil.which("chromedriver")
    if binary is None or driver_path is None:
        pytest.skip("needs chromium and chromedriver: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = binary
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(executable_path=driver_path)
    driver = webdriver.Chrome(options=options, service=service)
    try:
        yield Browser(driver)
    finally:
        driver.quit()
