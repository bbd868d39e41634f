#!/usr/bin/env python3
"""Builds the page to `dist/index.html`, one file that opens with a double click.

    run.py                     builds
    run.py --test              and tries it in headless Chromium, where that is or can be installed
    run.py --picture FILE.png  and takes its picture
"""

import base64
import gzip
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

HERE = pathlib.Path(__file__).resolve().parent
WASM = HERE / "target/wasm32-unknown-unknown/release/playground.wasm"
DATA = HERE.parents[1] / "tests/data/awe/orbit.json"
PAGE = HERE / "dist/index.html"
FLAGS = "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync"


def packed(data):
    return base64.b64encode(gzip.compress(data, 9, mtime=0)).decode()


def build():
    subprocess.run(["rustup", "target", "add", "wasm32-unknown-unknown"], capture_output=True)
    subprocess.run(["cargo", "build", "--quiet", "--locked", "--release"], cwd=HERE, check=True)
    data = json.loads(DATA.read_text())
    rows = data["guess_init"]
    numbers = [data["T"], *(v for key in ("x", "u") for row in rows[key] for v in row)]
    parts = {path.name: path.read_text() for path in (HERE / "page").iterdir()}
    page = parts.pop("index.html")
    for name, text in parts.items():
        page = page.replace(f"/* {name} */", text)
    page = page.replace("/* module */", packed(WASM.read_bytes()))
    page = page.replace("/* guess */", packed(struct.pack(f"<{len(numbers)}d", *numbers)))
    PAGE.parent.mkdir(exist_ok=True)
    PAGE.write_text(page)
    print(f"{WASM.name}: {WASM.stat().st_size} bytes; {PAGE}: {PAGE.stat().st_size} bytes")


def installed():
    """Whether Chromium and its driver are there, if need be after an installation."""
    there = lambda: shutil.which("chromium") and shutil.which("chromedriver")
    if not there() and shutil.which("apt-get") and os.geteuid() == 0:
        subprocess.run(["apt-get", "-qq", "update"], capture_output=True)
        get = ["apt-get", "-qq", "-y", "--no-install-recommends", "install", "chromium", "chromium-driver"]
        subprocess.run(get, capture_output=True)
    return there()


class Browser:
    """A session of the WebDriver protocol."""

    def __enter__(self):
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.driver = subprocess.Popen(["chromedriver", "--port=0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
        for line in self.driver.stdout:
            if "on port" in line and "successfully" in line:
                break
        port = line.split()[-1].rstrip(".")
        self.base = f"http://127.0.0.1:{port}"
        arguments = [*FLAGS.split(), f"--user-data-dir={self.profile.name}", "--window-size=1200,1360"]
        options = {"goog:chromeOptions": {"args": arguments}, "goog:loggingPrefs": {"browser": "ALL"}}
        session = self.call("POST", "/session", {"capabilities": {"alwaysMatch": options}})
        self.base += f"/session/{session['sessionId']}"
        return self

    def __exit__(self, *_):
        try:
            self.call("DELETE", "")
        finally:
            self.driver.terminate()
            self.driver.wait()
            self.profile.cleanup()

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + path, data, {"Content-Type": "application/json"}, method=method)
        try:
            with urllib.request.urlopen(request, timeout=90) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise RuntimeError(error.read().decode()) from error

    def run(self, script):
        return self.call("POST", "/execute/sync", {"script": script, "args": []})

    def until(self, script):
        for _ in range(600):
            if value := self.run(f"return {script}"):
                return value
            time.sleep(0.1)
        raise RuntimeError(f"in a minute it did not come to {script}")


# The state after some seconds that pass as fast as they can be computed, and the largest force.
LATER = """
let most = 0;
for (let k = 0; k < 60 * {seconds}; k++) {{ pendulum.advance(1 / 60, {push}); most = Math.max(most, Math.abs(pendulum.state()[4])); }}
return [pendulum.state(), most];
"""


def test(browser):
    def later(seconds, push="0"):
        return browser.run(LATER.format(seconds=seconds, push=push))

    def upright(when, state):
        # What is left of the slowest motion after some seconds is centimetres and degrees.
        position, angle = state[0], state[1] - state[10]
        if not (abs(angle) < 0.1 and abs(position) < 0.2):
            mistakes.append(f"{when} it is not upright: {state}")

    mistakes = []
    browser.until("pendulum.ready")
    browser.run("document.getElementById('pause').click(); pendulum.reset()")
    if abs(browser.run("return pendulum.state()")[1] - 3.14) > 0.01:
        mistakes.append("it does not hang at the start")
    swung, most = later(8)
    upright("after eight seconds", swung)
    # The tolerance of the QP.
    if most > 15 + 1e-6:
        mistakes.append(f"the force is {most} N, and may be 15")
    upright("two seconds later", later(2)[0])
    pushed, _ = later(0.2, "0, 2")
    if abs(pushed[1] - pushed[10]) + abs(pushed[3]) < 0.3:
        mistakes.append(f"a push is not felt: {pushed}")
    upright("after a push", later(10)[0])
    browser.run("let s = document.getElementById('setting-5'); s.value = Math.log(7); s.dispatchEvent(new Event('input')); pendulum.advance(.04)")
    state, most = later(1, "6")
    # Sliders have steps of a hundredth of their logarithm.
    if not 6.9 < most < 7.1:
        mistakes.append(f"a push of the cart needs all of the 7 N that are allowed; the force is at most {most}")
    samples = state[7]
    if not 500 < samples < 560:
        mistakes.append(f"{samples} samples in 21.24 seconds, of 0.04 s each")
    print(f"a sample: preparation {state[5] / samples:.3f} ms, feedback {state[6] / samples:.3f} ms; {state[8]:.0f} of {samples:.0f} had no solution")
    browser.run("document.getElementById('pause').click()")
    before = browser.run("return pendulum.state()[11]")
    browser.until(f"pendulum.state()[11] > {before + 0.5}")
    converged, iterations, objective, residual, took = browser.until("orbit.result && [...orbit.result]")
    print(f"the orbit: objective {objective:.8f} after {iterations:.0f} iterations, residual {residual:.0e}, {took:.0f} ms")
    # The interpolated tension moves the objective by 8e-7.
    if not (converged and abs(objective - json.loads(DATA.read_text())["objective"]) < 2e-6):
        mistakes.append("the orbit is not the reference")
    for entry in browser.call("POST", "/se/log", {"type": "browser"}):
        mistakes.append(f"console: {entry['level']}: {entry['message']}")
    return mistakes


def main():
    build()
    if len(sys.argv) == 1:
        return
    if not installed():
        print("Chromium and chromedriver are not installed: the page is not tried")
        return
    with Browser() as browser:
        browser.call("POST", "/url", {"url": PAGE.as_uri()})
        if "--picture" in sys.argv:
            browser.until("orbit.result")
            browser.run("pendulum.reset()")
            browser.until("pendulum.state()[11] > 1.1")
            browser.run("document.getElementById('pause').click()")
            picture = pathlib.Path(sys.argv[sys.argv.index("--picture") + 1])
            picture.write_bytes(base64.b64decode(browser.call("GET", "/screenshot")))
        mistakes = test(browser) if "--test" in sys.argv else []
    sys.exit("\n".join(mistakes) if mistakes else 0)


main()
