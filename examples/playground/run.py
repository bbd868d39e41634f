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

    def act(self, kind, *actions, **parameters):
        """What a hand does with a mouse (`pointer`) or on a keyboard (`key`)."""
        device = {"type": kind, "id": kind, "actions": list(actions), **parameters}
        self.call("POST", "/actions", {"actions": [device]})

    def element(self, selector):
        return self.call("POST", "/element", {"using": "css selector", "value": selector})


# The state after some seconds that pass as fast as they can be computed, and the largest force.
LATER = """
let most = 0;
for (let k = 0; k < 60 * {seconds}; k++) {{ pendulum.advance(1 / 60, {push}); most = Math.max(most, Math.abs(pendulum.state()[4])); }}
return [pendulum.state(), most];
"""


UPRIGHT = "(s => Math.abs(s[1] - s[10]) < .1 && Math.abs(s[0]) < .2 && Math.abs(s[3]) < .3)(pendulum.state())"


class Tried:
    """What is tried, and what is wrong."""

    def __init__(self, browser):
        self.browser, self.mistakes = browser, []

    def claim(self, holds, otherwise):
        if not holds:
            self.mistakes.append(otherwise)

    def later(self, seconds, push="0"):
        return self.browser.run(LATER.format(seconds=seconds, push=push))

    def upright(self, when, state):
        # What is left of the slowest motion after some seconds is centimetres and degrees.
        position, angle = state[0], state[1] - state[10]
        self.claim(abs(angle) < 0.1 and abs(position) < 0.2, f"{when} it is not upright: {state}")

    def slide(self, setting, value):
        self.browser.run(
            f"let s = document.getElementById('setting-{setting}'); s.value = Math.log({value}); s.dispatchEvent(new Event('input'))"
        )

    def swings(self):
        """It swings up, stands, is pushed, and stands again, as fast as that can be computed."""
        self.browser.run("pendulum.reset()")
        self.claim(abs(self.browser.run("return pendulum.state()")[1] - 3.14) < 0.01, "it does not hang at the start")
        swung, most = self.later(8)
        self.upright("after eight seconds", swung)
        # The tolerance of the QP.
        self.claim(most < 15 + 1e-6, f"the force is {most} N, and may be 15")
        self.upright("two seconds later", self.later(2)[0])
        pushed, _ = self.later(0.2, "0, 2")
        self.claim(abs(pushed[1] - pushed[10]) + abs(pushed[3]) > 0.3, f"a push is not felt: {pushed}")
        state, _ = self.later(10)
        self.upright("after a push", state)
        samples = state[7]
        self.claim(500 < samples < 510, f"{samples} samples in 20.2 seconds, of 0.04 s each")
        print(f"a sample: preparation {state[5] / samples:.3f} ms, feedback {state[6] / samples:.3f} ms; {state[8]:.0f} of {samples:.0f} had no solution")

    def obeys_sliders(self):
        """With other bounds it swings up too, within them."""
        for force, track in ((7, 0.6), (50, 1.8)):
            self.slide(5, force)
            self.slide(6, track)
            self.browser.run("pendulum.reset()")
            state, most = self.later(20)
            self.upright(f"with {force} N and {track} m", state)
            # Sliders have steps of a hundredth of their logarithm.
            self.claim(0.9 * force < most < 1.01 * force, f"the force is {most} N at most, and may be {force}")
        self.slide(5, 15)
        self.slide(6, 1)

    def feels_hands(self):
        """Mouse and keyboard, while time goes on."""
        run, canvas = self.browser.run, self.browser.element("#scene")
        run("pendulum.reset(); document.getElementById('pause').click()")
        self.browser.until(UPRIGHT)
        # The ball is dragged to the right, from where it is.
        scale = run("return document.getElementById('scene').clientWidth / 5.2")
        ball = lambda right: {"type": "pointerMove", "duration": 100, "origin": canvas, "x": int(right * scale), "y": int(20 - 0.8 * scale)}
        down, up = ({"type": f"pointer{way}", "button": 0} for way in ("Down", "Up"))
        self.browser.act("pointer", ball(0), down, ball(1), {"type": "pause", "duration": 150}, parameters={"pointerType": "mouse"})
        pull, dragged = run("return [pendulum.pull, pendulum.state()]")
        self.claim(pull and abs(pull[0] - 1) < 0.05 and abs(pull[1] - 0.8) < 0.05, f"the mouse pulls to {pull}, not to (1, 0.8)")
        self.claim(abs(dragged[1] - dragged[10]) + abs(dragged[2]) + abs(dragged[3]) > 0.3, f"the mouse is not felt: {dragged}")
        self.browser.act("pointer", up, parameters={"pointerType": "mouse"})
        self.claim(run("return pendulum.pull") is None, "the mouse pulls on when it is up")
        self.browser.until(UPRIGHT)
        # Keys push the ball, and with Shift the cart.
        key = lambda way, value: {"type": f"key{way}", "value": value}
        left, right, shift = "\ue012", "\ue014", "\ue008"
        run("document.getElementById('scene').focus()")
        for name, keys, forces in (("→", [right], [0, 2]), ("Shift ←", [shift, left], [-9, 0])):
            self.browser.act("key", *(key("Down", k) for k in keys), {"type": "pause", "duration": 150})
            pushes, state = run("return [pendulum.keys, pendulum.state()]")
            self.browser.act("key", *(key("Up", k) for k in reversed(keys)))
            self.claim(max(abs(a - b) for a, b in zip(pushes, forces)) < 0.1, f"{name} pushes with {pushes}, not {forces}")
            self.claim(abs(state[2]) + abs(state[3]) > 0.3, f"{name} is not felt: {state}")
            self.claim(run("return pendulum.keys") == [0, 0], f"{name} pushes on when it is up")
            self.browser.until(UPRIGHT)
        self.browser.act("key", key("Down", " "), key("Up", " "), key("Down", "r"), key("Up", "r"))
        paused, state = run("return [pendulum.paused, pendulum.state()]")
        self.claim(paused and abs(state[1] - 3.14) < 0.01, "Space does not pause, or R does not let it hang")
        self.browser.act("key", key("Down", " "), key("Up", " "))

    def goes_on_after_failure(self):
        """A push without measure is an error: that is said, and time goes on."""
        run = self.browser.run
        self.browser.until(UPRIGHT)
        run("pendulum.keys = [0, 1e200]")
        said = self.browser.until("document.getElementById('said').textContent")
        run("pendulum.keys = [0, 0]")
        self.claim(said.endswith("It hangs again.") and "Deviation" in said, f"a failure is said so: {said}")
        self.browser.until("pendulum.state()[11] > .5")
        self.browser.until(UPRIGHT)


def test(browser):
    tried = Tried(browser)
    browser.until("pendulum.ready")
    browser.run("document.getElementById('pause').click()")
    tried.swings()
    tried.obeys_sliders()
    tried.feels_hands()
    tried.goes_on_after_failure()
    converged, iterations, objective, residual, took = browser.until("orbit.result && [...orbit.result]")
    print(f"the orbit: objective {objective:.8f} after {iterations:.0f} iterations, residual {residual:.0e}, {took:.0f} ms")
    # The interpolated tension moves the objective by 8e-7.
    reference = json.loads(DATA.read_text())["objective"]
    tried.claim(converged and abs(objective - reference) < 1e-6, f"the orbit is not the reference, {reference}")
    for entry in browser.call("POST", "/se/log", {"type": "browser"}):
        tried.mistakes.append(f"console: {entry['level']}: {entry['message']}")
    return tried.mistakes


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
