"""The button of the page, in JavaScript with a simple copy of a browser: what it sends, and when it can be released."""

from typing import Any

import pytest

from tests.unit.station.test_page_lease import in_node

PROGRAM = """
import { readFileSync } from "node:fs";
const listeners = {}; // of the window, by type
const elements = {};
const sockets = [];
const sent = []; // on the connection of the lease
const intervals = [];
let timers = []; // [time, number, call]
let clock_ms = 1000;
const listen = (of) => (type, call) => (of[type] ??= []).push(call);
const made = () => {
  const own = {};
  return {
    own, dataset: {}, style: {}, hidden: false, textContent: "", value: "", maxLength: 24, classList: { add() {}, remove() {} },
    addEventListener: listen(own), animate: () => ({}),
  };
};
const element = (id) => (elements[id] ??= made());
Object.assign(globalThis, {
  addEventListener: listen(listeners),
  document: { addEventListener: listen(listeners), getElementById: element, body: element("body"), hidden: false, hasFocus: () => true },
  location: { protocol: "http:", host: "x", hash: "#code", pathname: "/" },
  history: { replaceState() {} },
  matchMedia: () => ({ matches: false }),
  setInterval: (call) => intervals.push(call),
  setTimeout: (call, after_ms = 0) => timers.push([clock_ms + after_ms, call]) && timers.at(-1),
  clearTimeout: (timer) => (timers = timers.filter((one) => one !== timer)),
  requestAnimationFrame: (call) => timers.push([clock_ms, call]),
  WebSocket: class {
    static OPEN = 1;
    readyState = 1;
    bufferedAmount = 0;
    constructor(url) { sockets.push(this); this.url = url; }
    send(text) { if (this.url === "ws://x/lease") sent.push(JSON.parse(text)); }
    close() { this.readyState = 3; }
  },
});
let hangs = false; // the browser's own process
const query = () => (hangs ? new Promise(() => {}) : Promise.resolve());
Object.defineProperty(globalThis, "navigator", { value: { locks: { query } } });
Object.defineProperty(globalThis, "performance", { value: { now: () => clock_ms } });
await import("./station.js");
const newest = () => sockets.filter((one) => one.url === "ws://x/lease").at(-1);
const hear = (message) => newest().onmessage({ data: JSON.stringify(message) });
const steps = {
  welcome() {
    newest().onopen();
    hear({ kind: "welcome", station: "phone", token: "token", may_drive: true });
  },
  view(fields) { hear({ kind: "view", problem: "", cause: "", latched: false, seen: false, required: true, driver: "", ...fields }); },
  hang(does) { hangs = does; },
  challenge(number) { hear({ kind: "lease", challenge: number, response: "0", stop: false }); },
  closed() { newest().onclose({ reason: "", code: 1006 }); },
  fill(id, value) {
    element(id).value = value;
    document.activeElement = element(id);
  },
  on(id, type, fields) { element(id).own[type].forEach((call) => call({ type, detail: 0, preventDefault() {}, ...fields })); },
  pass(after_ms) {
    clock_ms += after_ms;
    const due = timers.filter(([at_ms]) => at_ms <= clock_ms);
    timers = timers.filter(([at_ms]) => at_ms > clock_ms);
    for (const [, call] of due) call();
    for (const call of intervals) call();
  },
};
for (const [name, ...parts] of JSON.parse(readFileSync(0))) {
  steps[name](...parts);
  await new Promise(setImmediate);
}
console.log(JSON.stringify([sent, element("release").hidden, element("sentence").textContent]));
"""
Step = list[Any]
BEGUN: list[Step] = [["welcome"], ["view", {}]]
TOUCH: Step = ["on", "stop", "pointerdown"]
SEEN: Step = ["view", {"latched": True, "seen": True}]
HELD: list[Step] = [["on", "release", "pointerdown"], ["pass", 1000], ["on", "release", "pointerup"]]


def run(*steps: Step) -> tuple[list[dict[str, Any]], bool, str]:
    """Return what was sent on the connection of the lease, whether the release is hidden, and the sentence of the page."""
    return tuple(in_node(PROGRAM, steps))


def stops(sent: list[dict[str, Any]]) -> list[bool]:
    """Whether the button is pressed, in each message of the lease."""
    return [one["stop"] for one in sent if "stop" in one]


def test_a_touch_is_sent_in_its_own_event_and_in_all_messages_after_it() -> None:
    assert stops(run(*BEGUN)[0])[-1] is False
    assert stops(run(*BEGUN, TOUCH)[0])[-1] is True
    assert stops(run(*BEGUN, TOUCH, ["pass", 110], ["pass", 110])[0])[-3:] == [True] * 3


@pytest.mark.parametrize("before", [[], [["pass", 100]], [["pass", 600]]])
def test_a_touch_while_the_page_connects_again_is_in_its_first_message_of_the_lease(
    before: list[Step],
) -> None:
    lost: list[Step] = [*BEGUN, ["closed"], *before, TOUCH]
    sent, _, sentence = run(*lost)
    count = len(stops(sent))
    assert sentence.startswith("PRESSED, not confirmed.")
    assert stops(run(*lost, ["welcome"])[0])[count] is True


def test_a_further_touch_is_sent_as_one_and_the_click_of_a_touch_is_none() -> None:
    """Somebody may have reset the e-stop although this page is pressed."""
    click: Step = ["on", "stop", "click", {"detail": 1}]
    assert {"press": True} not in run(*BEGUN, TOUCH, click)[0]
    assert run(*BEGUN, TOUCH, click, TOUCH)[0][-2] == {"press": True}
    assert run(*BEGUN, TOUCH, ["on", "stop", "click", {"detail": 0}])[0][-2] == {"press": True}


def test_without_the_lease_a_press_is_released_after_a_status_has_shown_the_estop() -> None:
    _, is_hidden, sentence = run(*BEGUN, TOUCH)
    assert is_hidden
    assert sentence.startswith("PRESSED, not confirmed.")
    sent, is_hidden, sentence = run(*BEGUN, TOUCH, SEEN, ["pass", 50])
    assert (stops(sent)[-1], is_hidden) == (True, False)
    assert sentence.startswith("Pressed, and the robot is stopped.")
    sent, is_hidden, _ = run(*BEGUN, TOUCH, SEEN, *HELD)
    assert (stops(sent)[-1], is_hidden) == (False, True)


@pytest.mark.parametrize("problem", ["The supervisor has no station phone.", "Waiting for the supervisor."])
def test_a_page_that_is_not_heard_says_that_the_robot_is_stopped_only_while_a_status_shows_it(
    problem: str,
) -> None:
    """Somebody has reset the e-stop, or no status arrives: the page does not know whether the robot drives."""
    _, _, sentence = run(*BEGUN, TOUCH, SEEN, ["view", {"seen": True, "problem": problem}], ["pass", 50])
    assert "is stopped" not in sentence
    assert sentence.startswith("Pressed and confirmed, but perhaps reset since.")
    assert sentence.endswith(problem)


@pytest.mark.parametrize(
    "then",
    [
        [],
        [["view", {"latched": True}]],
        [SEEN, TOUCH],
        [SEEN, ["closed"]],
        [SEEN, *HELD, TOUCH],
    ],
)
def test_a_press_that_no_status_has_shown_yet_cannot_be_released(then: list[Step]) -> None:
    sent, is_hidden, _ = run(*BEGUN, TOUCH, *then, *HELD)
    assert (stops(sent)[-1], is_hidden) == (True, True)


def test_a_press_is_that_of_the_person_whose_name_is_still_being_entered() -> None:
    sent, _, _ = run(*BEGUN, ["fill", "name", "Ben"], TOUCH)
    assert sent[-2:-1] == [{"name": "Ben"}]
    assert sent[-1]["stop"] is True


def test_a_name_that_is_longer_than_the_server_accepts_is_cut() -> None:
    """An input method may enter more than the field permits; the server would close each connection of this page."""
    crabs = "\U0001f980" * 30
    sent, _, _ = run(["fill", "name", crabs], *BEGUN)
    assert sent[1] == {"name": crabs[:24]}


def test_a_page_that_comes_back_answers_although_the_browser_never_replied_before() -> None:
    """A page that was put into the history may get no reply to what it asked before."""
    lost: list[Step] = [
        *BEGUN,
        ["hang", True],
        ["challenge", "7"],
        ["closed"],
        ["pass", 600],
        ["hang", False],
    ]
    sent, _, _ = run(*lost, ["welcome"], ["challenge", "8"], ["pass", 0])
    assert [one["response"] for one in sent if "response" in one][-1] == "8"
