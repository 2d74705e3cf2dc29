"""Drives the live page in a real browser against a running server and checks what an artist would rely on.

    python3 check.py --url http://127.0.0.1:7878 --token TOKEN --job ID --frame 1 [--started-at UNIX_SECONDS]
    python3 check.py --url http://127.0.0.1:7878 --token TOKEN --submit 'karst submit scene.json'

One line per check, exit 0 when none failed. The pixels on the screen are compared with what this file computes
itself from the bytes that went over the WebSocket; the page is asked only where it put the picture.
Needs Chromium and the Python package playwright.
"""

import argparse
import bisect
import hashlib
import json
import os
import struct
import subprocess
import sys
import time
import urllib.parse
import zlib

from playwright.sync_api import sync_playwright

# Plain sRGB out of the compositor, and no traffic of the browser's own.
CHROMIUM = [
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--force-color-profile=srgb",
]
FIRST_PIXELS_SECONDS = 1.0
LONGEST_STILL = 0.5  # of the time that the frame took to improve
ENDED = ("Finished", "Failed", "Cancelled")


# ---- display values, as core/src/encode/view.rs and png.rs define them ------------------------------------


def f32(value):
    """Rounds to a 32-bit float."""
    return struct.unpack("<f", struct.pack("<f", value))[0]


def srgb_decode(encoded):
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


THRESHOLDS = [f32(srgb_decode((code + 0.5) / 255)) for code in range(255)]


def code(linear):
    """Display-linear light as an 8-bit sRGB code; NaN is 0."""
    return bisect.bisect_right(THRESHOLDS, linear) if linear == linear else 0


def filmic(light):
    rows_in = ((0.59719, 0.35458, 0.04823), (0.07600, 0.90834, 0.01566), (0.02840, 0.13383, 0.83777))
    rows_out = ((1.60475, -0.53108, -0.07367), (-0.10208, 1.10813, -0.00605), (-0.00327, -0.07276, 1.07602))
    scaled = [min(max(1.46193 * v, 0.0), 1e6) if v == v else 0.0 for v in light]
    fit = []
    for row in rows_in:
        v = max(sum(a * b for a, b in zip(row, scaled)), 0.0)
        fit.append((v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081))
    return [sum(a * b for a, b in zip(row, fit)) for row in rows_out]


def display(light, exposure, view):
    gain = f32(2.0**exposure)
    scaled = [f32(v * gain) if abs(v) < 1e30 else v for v in light]
    return tuple(code(v) for v in (filmic(scaled) if view == "filmic" else scaled))


# ---- what came over the wire ------------------------------------------------------------------------------


class Wire:
    """Collects the messages of every WebSocket of the page."""

    def __init__(self):
        self.watch = 0
        self.info = None
        self.tiles = {}
        self.answers = {}
        self.jobs = {}
        self.urls = []

    def attach(self, socket):
        self.urls.append(socket.url)
        socket.on("framereceived", self.received)

    def received(self, payload):
        if isinstance(payload, bytes):
            header = struct.unpack_from("<7If", payload)
            if header[0] >= self.watch:
                self.begin(header[0])
                self.tiles[header[1:3]] = (header, payload[32:])
            return
        message = json.loads(payload)
        if message["type"] == "probe":
            self.answers[(message.get("x"), message.get("y"))] = message.get("values", {})
        if message["type"] == "jobs":
            self.jobs = {job["id"]: job for job in message["jobs"]}
        if message["type"] == "frame" and message["watch"] >= self.watch:
            self.begin(message["watch"])
            self.info = message

    def begin(self, watch):
        if watch > self.watch:
            self.watch, self.info, self.tiles = watch, None, {}

    def light(self, x, y):
        """Linear values of a pixel at level 0, and their bytes; None where no tile came."""
        for (_, x0, y0, x1, y1, columns, _, _), halves in self.tiles.values():
            if x0 <= x < x1 and y0 <= y < y1 and columns == x1 - x0:
                at = ((y - y0) * columns + (x - x0)) * 6
                return struct.unpack_from("<3e", halves, at), halves[at : at + 6]
        return None


def png_pixels(data):
    """Width, height and rows of an 8-bit RGB or RGBA PNG, with the channels of a pixel."""
    at, packed, width, height, channels = 8, b"", 0, 0, 0
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack_from(">IIBB", body)
            channels = {2: 3, 6: 4}[colour]
            assert depth == 8, "8 bits a channel"
        elif kind == b"IDAT":
            packed += body
        at += 12 + length
    raw, stride = zlib.decompress(packed), width * channels
    rows, above = [], bytearray(stride)
    for y in range(height):
        start = y * (stride + 1)
        above = unfilter(raw[start], bytearray(raw[start + 1 : start + 1 + stride]), above, channels)
        rows.append(above)
    return width, height, channels, rows


def unfilter(kind, row, above, channels):
    """Undoes the filter of one row of a PNG."""
    for i in range(len(row)) if kind else ():
        left = row[i - channels] if i >= channels else 0
        up, corner = above[i], above[i - channels] if i >= channels else 0
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = up
        elif kind == 3:
            guess = (left + up) // 2
        else:
            p = left + up - corner
            guess = min(((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner)))[2]
        row[i] = (row[i] + guess) & 255
    return row


# ---- the checks -------------------------------------------------------------------------------------------


class Check:
    def __init__(self, page, wire, options):
        self.page, self.wire, self.options = page, wire, options
        self.failed = False

    def say(self, verdict, text):
        self.failed |= verdict == "FAIL"
        print(f"{verdict:4}  {text}", flush=True)

    def verdict(self, good, text):
        self.say("ok" if good else "FAIL", text)

    def state(self):
        return self.page.evaluate("karst.state()")

    def until(self, script, seconds):
        """Waits until a script is true; false when that does not happen."""
        limit = time.time() + seconds
        while time.time() < limit:
            if self.page.evaluate(script):
                return True
            self.page.wait_for_timeout(20)
        return False

    def shot(self):
        return self.page.screenshot(clip=self.page.locator("#picture").bounding_box())

    # Log in, open the job.

    def enter(self):
        page, options = self.page, self.options
        page.goto(options.url + "/")
        page.wait_for_selector("#token", state="visible")
        page.fill("#token", options.token)
        page.click("#login-button")
        good = self.until("document.querySelector('#lamp').dataset.state === 'open'", 10)
        self.verdict(good, "logged in with the token; the page is connected")
        return good

    def open_job(self):
        """Opens the job, or submits one and waits until the page goes to it by itself. Returns when it began."""
        options, job = self.options, self.options.job
        if options.submit:
            self.page.wait_for_timeout(300)
            known = set(self.wire.jobs)
            command = subprocess.Popen(options.submit, shell=True, stdout=subprocess.DEVNULL)
            limit = time.time() + options.timeout
            while not (set(self.wire.jobs) - known) and time.time() < limit:
                self.page.wait_for_timeout(10)
            new = set(self.wire.jobs) - known
            job = max(new, key=lambda each: self.wire.jobs[each]["submitted_at"], default=None)
            began = self.wire.jobs[job]["submitted_at"] if job else None
            self.command = command
        else:
            fields = {"job": job} if options.frame is None else {"job": job, "frame": options.frame}
            self.page.evaluate("(hash) => { location.hash = hash; }", urllib.parse.urlencode(fields))
            began = options.started_at
        wanted = f"s.job === {json.dumps(job)} && s.info !== null"
        if options.frame is not None:
            wanted += f" && s.frame === {options.frame} && s.info.frame === {options.frame}"
        good = job is not None and self.until(f"(s => {wanted})(karst.state())", options.timeout)
        self.verdict(good, f"opened job {job}")
        if good and options.submit and self.state()["follow"]:
            self.page.keyboard.press(" ")  # stays with the first frame
        return good, began

    def first_pixels(self, began):
        """Takes a picture of the first tiles. Returns what judges it: decoding takes longer than some jobs."""
        seen = self.until("karst.firstTileAt !== null", self.options.timeout)
        shot, state = (self.shot() if seen else b""), self.state()
        return lambda: self.judge_first_pixels(seen and self.lit(shot, state), began, seen)

    def judge_first_pixels(self, lit, began, seen):
        if began is None:
            self.verdict(lit, "the picture is on the screen (no --started-at: not timed)")
            return
        took = self.page.evaluate("karst.firstTileAt") - began if seen else float("inf")
        self.verdict(lit and took <= self.options.within, f"first pixels {took:.2f} s after the job began, at most {self.options.within} s")

    def lit(self, shot, state):
        """Whether any pixel of the picture, as it is on the screen, is brighter than the empty stage."""
        width, height, channels, rows = png_pixels(shot)
        place, info = state["place"], state["info"]
        x0, y0 = max(place["x"], 0), max(place["y"], 0)
        x1 = min(int(place["x"] + info["width"] * place["scale"]), width)
        y1 = min(int(place["y"] + info["height"] * place["scale"]), height)
        return any(max(rows[y][x * channels : x * channels + 3]) > 40 for y in range(y0, y1) for x in range(x0, x1))

    def keeps_changing(self):
        begun = self.state()
        if begun["frameState"] in ENDED:
            self.say("skip", f"the picture keeps changing: the frame was {begun['frameState']} before the page came")
            return
        limit, seen, last, longest = time.time() + self.options.timeout, set(), time.time(), 0.0
        start = last
        while time.time() < limit:
            state = self.state()
            digest = hashlib.sha256(self.shot()).digest()
            if digest not in seen:
                seen.add(digest)
                longest, last = max(longest, time.time() - last), time.time()
            if state["frame"] != begun["frame"] or (state["frameState"] in ENDED and state["ended"]):
                break
            self.page.wait_for_timeout(50)
        whole = last - start
        finished = state["ended"] and state["frameState"] == "Finished"
        good = finished and len(seen) >= 3 and longest <= max(LONGEST_STILL * whole, 2.0)
        self.verdict(good, f"{len(seen)} different pictures in {whole:.1f} s, {longest:.1f} s the longest still, then {state['frameState']}")

    def exposure(self):
        page = self.page
        page.keyboard.press("Escape")
        page.keyboard.press("1")
        # A new level may be on its way: the picture must have all tiles at level 0.
        good = self.until("karst.state().watch.level === 0 && karst.state().ended && karst.state().shown.covered >= 1", 30)
        pictures = set()
        for view, exposure in (("standard", 0.0), ("standard", -2.0), ("standard", 1.35), ("filmic", 0.0), ("filmic", 2.0)):
            if not good:
                break
            page.select_option("#view", view)
            page.fill("#exposure-number", str(exposure))
            page.locator("#exposure-number").blur()
            page.wait_for_timeout(300)
            pictures.add(self.compare(exposure, view))
        self.verdict(good and len(pictures) == 5, "every exposure and view gives another picture")
        before = self.state()["look"]["exposure"]
        page.keyboard.press("e")
        page.wait_for_timeout(200)
        after = self.state()["look"]["exposure"]
        self.verdict(after == before + 0.5, f"key E: {before} to {after} stops")
        page.keyboard.press("0")

    def compare(self, exposure, view):
        """Every visible pixel of the picture against the half floats of the wire; returns a digest of the screen."""
        shot = self.shot()
        width, height, channels, rows = png_pixels(shot)
        place = self.state()["place"]
        exact, close, wrong, worst = 0, 0, 0, 0
        known = {}
        for (_, x0, y0, x1, y1, columns, _, _), halves in self.wire.tiles.values():
            for y in range(y0, y1):
                screen_y = y + place["y"]
                if not 0 <= screen_y < height:
                    continue
                for x in range(max(x0, -place["x"]), min(x1, width - place["x"])):
                    at = ((y - y0) * columns + (x - x0)) * 6
                    bits = halves[at : at + 6]
                    want = known.get(bits)
                    if want is None:
                        want = known[bits] = display(struct.unpack("<3e", bits), exposure, view)
                    column = (x + place["x"]) * channels
                    off = max(abs(a - b) for a, b in zip(want, rows[screen_y][column : column + 3]))
                    exact, close, wrong = exact + (off == 0), close + (off == 1), wrong + (off > 1)
                    worst = max(worst, off)
        text = f"{view}, {exposure:+} stops: {exact} pixels exact, {close} off by 1 of 255, {wrong} by more (worst {worst})"
        self.verdict(wrong == 0 and exact > 1000 and exact > 50 * close, text)
        return hashlib.sha256(shot).digest()

    def bring_into_view(self, x, y):
        """Drags the picture until a pixel is well inside the canvas; returns where it is in the window."""
        box = self.page.locator("#picture").bounding_box()
        middle = (box["width"] / 2, box["height"] / 2)
        for _ in range(200):
            place = self.state()["place"]
            at = (place["x"] + (x + 0.5) * place["scale"], place["y"] + (y + 0.5) * place["scale"])
            if 8 < at[0] < box["width"] - 8 and 8 < at[1] < box["height"] - 60:
                break
            step = [max(-250, min(250, m - a)) for m, a in zip(middle, at)]
            self.page.mouse.move(box["x"] + middle[0], box["y"] + middle[1])
            self.page.mouse.down()
            self.page.mouse.move(box["x"] + middle[0] + step[0] / 2, box["y"] + middle[1] + step[1] / 2)
            self.page.mouse.move(box["x"] + middle[0] + step[0], box["y"] + middle[1] + step[1])
            self.page.mouse.up()
        return box["x"] + at[0], box["y"] + at[1]

    def probe(self):
        info = self.state()["info"]
        x0, y0, x1, y1 = info["window"]
        wanted = self.options.exr_values or []
        for pixel in wanted or [{"x": x0, "y": y0}, {"x": (x0 + x1) // 2, "y": (y0 + y1) // 2}, {"x": x1 - 1, "y": y1 - 1}]:
            x, y = pixel["x"], pixel["y"]
            self.page.mouse.click(*self.bring_into_view(x, y))
            here = f"karst.probe && karst.probe.x === {x} && karst.probe.y === {y} && karst.probe.values"
            answered = self.until(here, 5)
            self.page.wait_for_timeout(60)
            numbers = self.page.eval_on_selector_all("#probe-values .number", "all => all.map(e => [e.dataset.layer, e.textContent])")
            shown = {}
            for layer, text in numbers if answered else ():
                shown.setdefault(layer, []).append(float("nan") if text == "not finite" else float(text))
            self.probed(pixel, shown)

    def probed(self, pixel, shown):
        x, y = pixel["x"], pixel["y"]
        bits = lambda values: [struct.pack("<f", v) if v is not None and v == v else b"nan" for v in values]
        for layer in [name for name in pixel if name not in ("x", "y")]:
            good = layer in shown and bits(shown[layer]) == bits(pixel[layer])
            self.verdict(good, f"probe {x}, {y}: {layer} {shown.get(layer)} is bit for bit {pixel[layer]}")
        answer = self.wire.answers.get((x, y), {})
        same = bool(answer) and {name: bits(values) for name, values in answer.items()} == {k: bits(v) for k, v in shown.items()}
        self.verdict(same, f"probe {x}, {y}: {len(answer)} layers are shown as the server sent them, bit for bit")
        found = self.wire.light(x, y)
        if found and max(map(abs, found[0])) < 60000:
            same = "Color" in shown and struct.pack("<3e", *shown["Color"]) == found[1]
            self.verdict(same, f"probe {x}, {y}: {shown.get('Color')} rounds to the half floats of the picture")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--url", required=True)
    parser.add_argument("--token", required=True)
    parser.add_argument("--job", help="job to open")
    parser.add_argument("--frame", type=int, help="frame to open; without it the page follows the one that renders")
    parser.add_argument("--submit", help="command that submits a job once the page is open, instead of --job")
    parser.add_argument("--started-at", type=float, help="Unix time at which the job began; with --submit the server's")
    parser.add_argument("--exr-values", help='exact floats, as JSON or a file of it: {"x": 1, "y": 2, "Color": [r, g, b]}, or a list')
    parser.add_argument("--screenshot", help="PNG of the whole window at the end")
    parser.add_argument("--within", type=float, default=FIRST_PIXELS_SECONDS, help="most seconds until the first pixels are on the screen")
    parser.add_argument("--timeout", type=float, default=120, help="most seconds until the frame is finished")
    parser.add_argument("--chromium", default="/usr/bin/chromium")
    options = parser.parse_args()
    if not options.job and not options.submit:
        parser.error("--job or --submit")
    if options.exr_values:
        text = options.exr_values
        if os.path.exists(text):
            with open(text, encoding="utf-8") as file:
                text = file.read()
        values = json.loads(text)
        options.exr_values = values if isinstance(values, list) else [values]
    options.url = options.url.rstrip("/")
    return options


def run(page, options, errors, requests):
    wire = Wire()
    page.on("websocket", wire.attach)
    check = Check(page, wire, options)
    if check.enter():
        opened, began = check.open_job()
        if opened:
            judge_first_pixels = check.first_pixels(began)
            check.keeps_changing()
            judge_first_pixels()
            check.exposure()
            check.probe()
            if options.submit:
                check.command.wait(options.timeout)
    if options.screenshot:
        page.screenshot(path=options.screenshot)
    # Asking for the session before the login is answered by 401, which the browser itself notes as an error.
    own = [text for text in errors if not ("401" in text and "/api/session" in text)]
    check.verdict(not own, f"no errors on the console{': ' + '; '.join(own) if own else ''}")
    origin = urllib.parse.urlsplit(options.url).netloc
    foreign = [url for url in requests + wire.urls if urllib.parse.urlsplit(url).netloc not in (origin, "") or url.startswith("blob:")]
    check.verdict(not foreign, f"no request to another origin{': ' + ', '.join(foreign) if foreign else ''} ({len(requests)} requests)")
    return 1 if check.failed else 0


def main():
    options = arguments()
    errors, requests = [], []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=options.chromium, args=CHROMIUM)
        page = browser.new_page(viewport={"width": 1440, "height": 900}, device_scale_factor=1)
        page.on("console", lambda m: m.type == "error" and errors.append(f"{m.text} ({m.location.get('url', '')})"))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("request", lambda request: requests.append(request.url))
        code_ = run(page, options, errors, requests)
        browser.close()
    return code_


if __name__ == "__main__":
    sys.exit(main())
