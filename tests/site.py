"""Looks at every page of the site in a browser, as wide as a desk has it and as narrow as a telephone.

    python3 tests/site.py [--pictures FOLDER] [PAGE ...]      after `ninja -C build site` (or ./check site, which makes it)

Of each page at either width: the browser's console has no error; every formula is set, and no `$` of one is left in the
text; every picture has come; nothing is wider than the window, except what scrolls by itself; no letter is smaller than
can be read; what is highlighted as code has a button that copies it. The search finds what is asked for. A server of this
program's own gives the pages, and nothing else may be asked for. `--pictures` keeps what was seen. Exit code 1 where
something is wrong.
"""
import argparse
import functools
import glob
import http.server
import os
import sys
import tempfile
import threading
import time

from selenium import webdriver
from selenium.webdriver.chrome.options import Options
from selenium.webdriver.chrome.service import Service

SOURCE = os.environ.get("STICKSLIP_SOURCE", os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
WIDTHS = (1200, 420)
LOOK = """
const wrong = [], page = document.querySelector("article") || document.body, shown = e => e.getClientRects().length > 0;
const words = document.createTreeWalker(page, NodeFilter.SHOW_TEXT);
for (let word; (word = words.nextNode());) {
  const place = word.parentElement, text = word.textContent.trim();
  if (!text || !shown(place) || place.closest("script, style, .katex")) continue;
  if (text.includes("$") && !place.closest("code, pre")) wrong.push("a $ is left: " + text.slice(0, 60));
  if (/\\\\[a-zA-Z]+[{_^]/.test(text) && !place.closest("code, pre")) wrong.push("a formula is left: " + text.slice(0, 60));
  if (parseFloat(getComputedStyle(place).fontSize) < 10) wrong.push("small letters: " + text.slice(0, 60));
}
for (const name of page.querySelectorAll("td code, th code"))
  if (/^\\w+$/.test(name.textContent) && name.getClientRects().length > 1) wrong.push("a broken name: " + name.textContent);
const formulas = page.querySelectorAll(".arithmatex");
for (const formula of formulas)
  if (!formula.querySelector(".katex") || formula.querySelector(".katex-error"))
    wrong.push("a formula is not set: " + formula.textContent.slice(0, 60));
for (const picture of page.querySelectorAll("img"))
  if (!picture.naturalWidth) wrong.push("a picture has not come: " + picture.src);
for (const code of page.querySelectorAll(".highlight pre"))
  if (!code.querySelector(".md-clipboard")) {  // it comes when the code is in sight
    code.scrollIntoView();
    wrong.push("nothing copies " + code.textContent.slice(0, 40));
    break;
  }
const within = e => { for (; e && e !== page; e = e.parentElement) if (getComputedStyle(e).overflowX !== "visible") return true; };
for (const part of page.querySelectorAll("*"))
  if (shown(part) && part.getBoundingClientRect().right > innerWidth + 1 && !within(part) && !part.closest("svg, .katex-mathml"))
    wrong.push("wider than the window: <" + part.tagName.toLowerCase() + "> " + part.textContent.trim().slice(0, 60));
if (document.documentElement.scrollWidth > innerWidth) wrong.push("the page scrolls sideways");
const others = performance.getEntriesByType("resource").map(r => r.name).filter(n => !n.startsWith(location.origin) && !n.startsWith("data:"));
return {wrong: wrong.concat(others.map(n => "asks for " + n)), formulas: formulas.length};
"""


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def browser():
    options = Options()
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"):
        options.add_argument(word)
    options.binary_location = "/usr/bin/chromium"
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    return webdriver.Chrome(service=Service("/usr/bin/chromedriver"), options=options)


def resize(window, width, height):
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {"width": width, "height": height, "deviceScaleFactor": 1,
                                                                  "mobile": width < 800})


def looked_at(window, address, width, picture):
    """What is wrong with a page, and how many formulas it has."""
    resize(window, width, 900)
    window.get(address)
    window.execute_async_script("const done = arguments[0]; document.fonts.ready.then(() => requestAnimationFrame(done));")
    resize(window, width, min(window.execute_script("return document.documentElement.scrollHeight"), 16000))  # all in sight
    for _ in range(100):
        seen = window.execute_script(LOOK)
        if not seen["wrong"]:
            break
        time.sleep(0.1)
    if picture:
        window.execute_script("scrollTo(0, 0)")
        window.save_screenshot(picture)
    said = [line["message"] for line in window.get_log("browser") if line["level"] in ("SEVERE", "WARNING")]
    return seen["wrong"] + [f"the console says {words}" for words in said], seen["formulas"]


def found(window, address, words, page):
    """Whether the search for the words leads to the page."""
    resize(window, WIDTHS[0], 900)
    window.get(address)
    field = window.find_element("css selector", ".md-search__input")
    field.click()
    field.send_keys(words)
    for _ in range(100):
        links = [link.get_attribute("href") for link in window.find_elements("css selector", ".md-search-result__link")]
        if any(f"/{page}" in link for link in links):
            return True
        time.sleep(0.1)
    return False


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("pages", nargs="*", metavar="PAGE", help="as index, stability or developers/adding; without any, all")
    parser.add_argument("--site", default=os.path.join(SOURCE, "build", "site"), metavar="FOLDER")
    parser.add_argument("--pictures", metavar="FOLDER")
    asked = parser.parse_args()
    pages = [page + ".html" for page in asked.pages] or sorted(
        name for name in glob.glob("**/*.html", root_dir=asked.site, recursive=True) if name != "404.html")
    if not pages:
        sys.exit(f"{asked.site} has no pages; ninja -C build site makes them")
    if asked.pictures:
        os.makedirs(asked.pictures, exist_ok=True)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=asked.site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    root = f"http://127.0.0.1:{server.server_port}/"
    failed = formulas = 0
    with tempfile.TemporaryDirectory() as home:
        os.environ["HOME"] = home  # where the browser keeps its own
        window = browser()
        try:
            for page in pages:
                for width in WIDTHS:
                    picture = asked.pictures and os.path.join(asked.pictures, f"{page[:-5].replace('/', '-')}-{width}.png")
                    wrong, count = looked_at(window, root + page, width, picture)
                    formulas += count
                    failed += bool(wrong)
                    for words in dict.fromkeys(wrong):
                        print(f"{page}, {width} wide: {words}", flush=True)
            if not asked.pages and not found(window, root + pages[0], "canard explosion", "waves.html"):
                failed += 1
                print("the search for 'canard explosion' does not find waves.html")
        finally:
            window.quit()
            server.shutdown()
    print(f"{len(pages)} pages at {len(WIDTHS)} widths, {formulas // len(WIDTHS)} formulas; {failed} failed")
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main())
