"""The hands at a page that drives, in JavaScript with a simple copy of a browser: what each event sends to the server."""

import json
import subprocess
from typing import Any

import pytest

from tests.unit.station.test_page_lease import NODE, PAGE

PROGRAM = """
import { readFileSync } from "node:fs";
const listeners = {}; // of the window, by type
const elements = {};
const frames = [];
const sent = [];
let clock_ms = 1000;
let pads = [];
const listen = (of) => (type, call) => (of[type] ??= []).push(call);
const made = (id) => {
  const own = {};
  const map = { clientWidth: 300, clientHeight: 300, getContext: () => new Proxy({}, { get: () => () => {}, set: () => true }) };
  return {
    own, dataset: {}, style: {}, hidden: false, textContent: "", value: "5", ...(id === "map" ? map : {}),
    addEventListener: listen(own), setPointerCapture: () => {},
    getBoundingClientRect: () => ({ x: 0, y: 0, width: 200, height: 200 }),
  };
};
const element = (id) => (elements[id] ??= made(id));
Object.assign(globalThis, {
  addEventListener: listen(listeners),
  document: { addEventListener: listen(listeners), getElementById: element, body: element("body") },
  location: { protocol: "http:", host: "x" },
  matchMedia: () => ({ matches: false }),
  devicePixelRatio: 1,
  setInterval: () => {},
  requestAnimationFrame: (call) => frames.push(call),
  WebSocket: class {
    static OPEN = 1;
    readyState = 1;
    bufferedAmount = 0;
    constructor(url) { (globalThis.sockets ??= []).push(this); this.url = url; }
    send(text) { sent.push(JSON.parse(text)); }
    close() { this.readyState = 3; }
  },
});
Object.defineProperty(globalThis, "navigator", { value: { getGamepads: () => pads } });
Object.defineProperty(globalThis, "performance", { value: { now: () => clock_ms } });
const drive = await import("./drive.js");
const pictures = await import("./picture.js");
const event = (fields) => ({ preventDefault() {}, button: 0, buttons: 1, pointerId: 1, pointerType: "mouse", ...fields });
const steps = {
  begin() {
    drive.offer("token");
    element("drive-begin").own.click.forEach((call) => call());
  },
  told(sentence) { sockets.at(-1).onmessage({ data: JSON.stringify({ kind: "told", sentence }) }); },
  on(id, type, fields) {
    for (const call of [...(listeners[`capture ${type}`] ?? []), ...(element(id).own[type] ?? []), ...(listeners[type] ?? [])]) {
      call(event(fields));
    }
  },
  window(type, fields) { (listeners[type] ?? []).forEach((call) => call(event(fields))); },
  frame(after_ms) {
    clock_ms += after_ms;
    frames.splice(0).forEach((call) => call());
  },
  pads(all) { pads = all; },
  map(size) { Object.assign(element("map"), { clientWidth: size, clientHeight: size }); },
  pictures() { pictures.begin("token"); },
  shown(message) { sockets.at(-1).onmessage({ data: JSON.stringify(message) }); },
  closed(reason) { sockets.at(-1).onclose({ reason }); },
};
for (const [name, ...parts] of JSON.parse(readFileSync(0))) steps[name](...parts);
const texts = Object.fromEntries(Object.entries(elements).map(([id, one]) => [id, one.textContent]));
console.log(JSON.stringify([sent, texts, pictures.drawn()]));
"""
Step = list[Any]
BEGUN: list[Step] = [["begin"], ["told", ""], ["frame", 50]]
PULLED: list[Step] = [
    ["on", "stick", "pointerdown", {"clientX": 100, "clientY": 100}],
    ["window", "pointermove", {"clientX": 100, "clientY": 0}],
    ["frame", 50],
]
W: Step = ["window", "keydown", {"code": "KeyW"}]


def run(*steps: Step) -> tuple[list[dict[str, Any]], dict[str, str], int]:
    """Return what was sent, the texts of the page's elements, and the number of the newest picture that counts as drawn."""
    node = [str(NODE), "--input-type=module", "--eval", PROGRAM]
    done = subprocess.run(
        node, cwd=PAGE, input=json.dumps(steps), capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    return tuple(json.loads(done.stdout))


def newest(*steps: Step) -> float:
    """Return the straight velocity that was sent last, after Drive was pressed."""
    return run(*BEGUN, *steps)[0][-1]["linear"]


def test_a_stick_drives_until_its_button_is_released() -> None:
    assert newest(*PULLED) == 1
    assert newest(*PULLED, ["window", "pointerup", {}]) == 0


def test_a_stick_whose_left_button_is_released_while_another_one_is_pressed_is_released() -> None:
    assert newest(*PULLED, ["window", "pointermove", {"clientX": 100, "clientY": 0, "buttons": 2}]) == 0


@pytest.mark.parametrize("modifier", ["ctrlKey", "altKey", "metaKey"])
def test_a_key_that_makes_a_shortcut_lets_go_of_everything(modifier: str) -> None:
    shortcut = ["window", "keydown", {"code": "MetaLeft", modifier: True}]
    assert newest(W) == 1
    assert newest(W, shortcut) == 0
    assert newest(W, shortcut, ["frame", 50], ["window", "keydown", {"code": "KeyW", "repeat": True}]) == 0


@pytest.mark.parametrize("hertz", [60, 144, 240])
def test_a_hand_that_moves_all_the_time_sends_less_than_the_server_accepts_and_its_zero_at_once(
    hertz: int,
) -> None:
    moves = [
        step
        for number in range(hertz)
        for step in (
            ["window", "pointermove", {"clientX": 100, "clientY": number % 50}],
            ["frame", 1000 / hertz],
        )
    ]
    sent, _, _ = run(*BEGUN, PULLED[0], *moves)
    assert 25 < len(sent) < 45
    assert newest(*PULLED, ["window", "pointermove", {"clientX": 100, "clientY": 100}]) == 0


def test_a_page_whose_driving_was_ended_and_begun_again_has_one_heartbeat() -> None:
    again = [["closed", "x"], *BEGUN[:2]]
    sent, _, _ = run(*BEGUN, *again * 5, ["frame", 50], ["frame", 50])
    assert len(sent) == 3
