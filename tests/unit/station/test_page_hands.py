"""The hands at a page that drives, in JavaScript with a simple copy of a browser: what each event sends to the server."""

from itertools import permutations
from typing import Any

import pytest

from tests.unit.station.test_page_lease import in_node

PROGRAM = """
import { readFileSync } from "node:fs";
const listeners = {}; // of the window, by type
const elements = {};
const frames = [];
const sent = [];
let clock_ms = 1000;
let pads = [];
let hasFocus = true;
let hangs = false; // the browser's own process
const listen = (of) => (type, call, isFirst) => (of[isFirst ? `first ${type}` : type] ??= []).push(call);
const made = (id) => {
  const own = {};
  const map = { clientWidth: 300, clientHeight: 300, getContext: () => new Proxy({}, { get: () => () => {}, set: () => true }) };
  return {
    own, dataset: new Proxy({}, { set: (all, name, value) => Reflect.set(all, name, String(value)) }), style: {}, hidden: false, textContent: "", value: "5", maxLength: 24, ...(id === "map" ? map : {}),
    addEventListener: listen(own), setPointerCapture: () => {},
    getBoundingClientRect: () => ({ x: 0, y: 0, width: 200, height: 200 }),
  };
};
const element = (id) => (elements[id] ??= made(id));
Object.assign(globalThis, {
  addEventListener: listen(listeners),
  document: { addEventListener: listen(listeners), getElementById: element, body: element("body"), hasFocus: () => hasFocus },
  location: { protocol: "http:", host: "x" },
  matchMedia: () => ({ matches: false }),
  devicePixelRatio: 1,
  setInterval: () => {},
  setTimeout: (call) => frames.push(call),
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
Object.defineProperty(globalThis, "navigator", {
  value: { getGamepads: () => pads, locks: { query: () => (hangs ? new Promise(() => {}) : Promise.resolve()) } },
});
Object.defineProperty(globalThis, "performance", { value: { now: () => clock_ms } });
const drive = await import("./drive.js");
const pictures = await import("./picture.js");
const event = (fields) => ({ preventDefault() {}, button: 0, buttons: 1, pointerId: 1, pointerType: "mouse", ...fields });
const steps = {
  begin() {
    drive.offer("token");
    element("drive-begin").own.click.forEach((call) => call());
  },
  turn(drives, asker, sentence) { sockets.at(-1).onmessage({ data: JSON.stringify({ kind: "turn", drives, asker, sentence }) }); },
  driver(name) { drive.show(name); },
  answer(sentence) { sockets.at(-1).onmessage({ data: JSON.stringify({ kind: "answer", sentence }) }); },
  on(id, type, fields) {
    for (const call of [...(listeners[`first ${type}`] ?? []), ...(element(id).own[type] ?? []), ...(listeners[type] ?? [])]) {
      call(event(fields));
    }
  },
  window(type, fields) { (listeners[type] ?? []).forEach((call) => call(event(fields))); },
  frame(after_ms) {
    clock_ms += after_ms;
    frames.splice(0).forEach((call) => call());
  },
  pads(all) { pads = all; },
  focus(is) { hasFocus = is; },
  hang() { hangs = true; },
  open() { sockets.at(-1).onopen(); },
  fill(id, value) { element(id).value = value; },
  map(size) { Object.assign(element("map"), { clientWidth: size, clientHeight: size }); },
  pictures() { pictures.begin("token"); },
  shown(message) { sockets.at(-1).onmessage({ data: JSON.stringify(message) }); },
  closed(reason, code) { sockets.at(-1).onclose({ reason, code }); },
};
for (const [name, ...parts] of JSON.parse(readFileSync(0))) {
  steps[name](...parts);
  await new Promise(setImmediate); // the browser replies
}
const texts = Object.fromEntries(Object.entries(elements).map(([id, one]) => [id, one.textContent]));
console.log(JSON.stringify([sent, { ...texts, sockets: sockets.map((one) => one.url).join(" "), isPictureShown: String(!element("picture").hidden) }, pictures.drawn()]));
"""
Step = list[Any]
TURN: Step = ["turn", True, "", ""]
BEGUN: list[Step] = [["begin"], TURN, ["frame", 50]]
ASKS: list[Step] = [["begin"], ["turn", False, "", "Wait for Anna."]]
PULLED: list[Step] = [
    ["on", "stick", "pointerdown", {"clientX": 100, "clientY": 100}],
    ["window", "pointermove", {"clientX": 100, "clientY": 0}],
    ["frame", 50],
]
W: Step = ["window", "keydown", {"code": "KeyW"}]


def run(*steps: Step) -> tuple[list[dict[str, Any]], dict[str, str], int]:
    """Return what was sent, the texts of the page's elements, and the number of the newest picture that counts as drawn."""
    return tuple(in_node(PROGRAM, steps))


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


def touch(place: str, pointer: int) -> Step:
    return [
        "on",
        place,
        "pointerdown",
        {"clientX": 100, "clientY": 0, "pointerId": pointer, "pointerType": "touch"},
    ]


@pytest.mark.parametrize("place", ["enable", "stick", "speed", "body"])
def test_a_third_finger_anywhere_lets_go_of_everything(place: str) -> None:
    thumbs = [touch("enable", 1), touch("stick", 2)]
    assert newest(*thumbs) == 1
    assert newest(*thumbs, touch(place, 3)) == 0
    assert newest(*thumbs, touch(place, 3), ["frame", 50]) == 0


def pad(*, held: bool, mapping: str = "standard", index: int = 1) -> list[Step]:
    """A gamepad that is pulled ahead, and a frame in which it is read."""
    buttons = [{"pressed": held and number == 4} for number in range(5)]
    one = {"index": index, "connected": True, "mapping": mapping, "buttons": buttons, "axes": [0, -1]}
    return [["pads", [None, one]], ["frame", 250]]


@pytest.mark.parametrize(("mapping", "share"), [("standard", 1), ("", 0)])
def test_a_gamepad_without_the_standard_mapping_does_not_drive(mapping: str, share: float) -> None:
    assert newest(*pad(held=False, mapping=mapping), *pad(held=True, mapping=mapping)) == share


def test_a_gamepad_drives_only_the_page_that_has_the_focus() -> None:
    """Two pages in sight of one browser, of two robots, read the same gamepad."""
    assert newest(*pad(held=False), *pad(held=True)) == 1
    assert newest(["focus", False], *pad(held=False), *pad(held=True)) == 0
    lost: list[Step] = [*pad(held=False), *pad(held=True), ["focus", False], ["frame", 50]]
    assert newest(*lost) == 0
    assert newest(*lost, ["focus", True], ["frame", 50]) == 0, "still held"
    assert newest(*lost, ["focus", True], *pad(held=False), *pad(held=True)) == 1


LOST: Step = ["window", "gamepaddisconnected", {}]


@pytest.mark.parametrize(("lost", "index"), [([], 0), ([], 2), ([LOST], 0), ([LOST], 1)])
def test_another_gamepad_that_is_held_when_it_comes_must_be_released_first(
    lost: list[Step], index: int
) -> None:
    """When the first one is disconnected, the browser may give its number, 1, to the other one."""
    changed: list[Step] = [*pad(held=False), *lost, *pad(held=True, index=index)]
    assert newest(*changed, ["frame", 50]) == 0
    assert newest(*changed, *pad(held=False, index=index), *pad(held=True, index=index)) == 1


LIFTS: dict[str, Step] = {
    "stick": ["window", "pointerup", {}],
    "key": ["window", "keyup", {"code": "KeyW"}],
    "pad": ["pads", []],
}


@pytest.mark.parametrize(("first", "second"), list(permutations(LIFTS, 2)))
def test_the_release_of_one_of_two_controls_begins_no_motion(first: str, second: str) -> None:
    holds = {"stick": PULLED, "key": [W], "pad": [*pad(held=False), *pad(held=True)]}
    two = [*holds[first], *holds[second], ["frame", 50]]
    assert newest(*two) == 0
    assert run(*BEGUN, *two)[1]["drive-reason"] == "Two controls are held: release both, and press one."
    for lifted in (first, second):
        assert newest(*two, LIFTS[lifted], ["frame", 50], ["frame", 50]) == 0
    free: list[Step] = [*LIFTS.values(), ["frame", 50]]
    assert newest(*two, *free, *holds[first]) == 1


def test_after_the_enable_button_the_stick_must_be_touched_again() -> None:
    released = [touch("enable", 1), touch("stick", 2), ["window", "pointerup", {"pointerId": 1}]]
    assert newest(*released, touch("enable", 1), ["frame", 50]) == 0
    assert "touch both again" in run(*BEGUN, *released)[1]["drive-reason"]
    assert newest(*released, touch("enable", 1), touch("stick", 2)) == 1


def test_a_page_that_changes_its_size_lets_go_because_the_stick_is_at_another_place() -> None:
    turned: list[Step] = [*PULLED, ["window", "resize", {}]]
    assert newest(*turned) == 0
    assert newest(*turned, ["window", "pointermove", {"clientX": 100, "clientY": 0}], ["frame", 50]) == 0


HELD: list[list[Step]] = [
    [*BEGUN, W, ["window", "blur", {}]],
    [*BEGUN, ["window", "keydown", {"code": "KeyW", "ctrlKey": True}]],
    [*BEGUN, ["window", "keydown", {"code": "KeyW", "repeat": True}]],
    [W, *BEGUN],
    [*BEGUN, W, ["on", "drive-end", "click", {}], *BEGUN],
]
"""How a key is held without a press that counts."""


@pytest.mark.parametrize("held", HELD)
def test_a_key_drives_again_only_after_the_page_has_seen_its_release(held: list[Step]) -> None:
    """A browser may report a held key as newly pressed, as when the page gets the focus again or Ctrl is released."""
    again: list[Step] = [*held, ["window", "keyup", {"code": "ControlLeft"}], W]
    sent, texts, _ = run(*again)
    assert sent[-1]["linear"] == 0
    assert "release it, and press again" in texts["drive-reason"]
    assert run(*again, ["window", "keyup", {"code": "KeyW"}], W)[0][-1]["linear"] == 1


@pytest.mark.parametrize("hold", [[W], PULLED, [*pad(held=False), *pad(held=True)]])
def test_while_the_process_of_the_browser_hangs_that_carries_the_hands_nothing_is_held(
    hold: list[Step],
) -> None:
    """The script, its frames and its connections go on without this process; only its lease, if it has one, would end."""
    frames: list[Step] = [["frame", 50]] * 8
    assert newest(*hold, *frames) == 1
    assert newest(*hold, ["hang"], *frames) == 0
    assert "The browser hangs" in run(*BEGUN, *hold, ["hang"], *frames)[1]["drive-reason"]


def test_a_page_asks_to_drive_under_the_name_that_it_shows() -> None:
    """The name is sent on another connection too, which may be slower."""
    assert run(["fill", "name", "Ben"], ["begin"], ["open"])[0] == [{"token": "token", "name": "Ben"}]


def test_a_reset_of_a_page_that_asks_is_sent_so_that_the_server_refuses_it() -> None:
    asks: list[Step] = [["begin"], ["turn", False, "", "Wait for Anna."], ["frame", 50]]
    assert run(*asks, ["on", "reset", "click", {}])[0][-1] == {"request": "reset"}


def test_a_refusal_lets_go_and_is_shown_until_something_is_held_again() -> None:
    refused: list[Step] = [*BEGUN, W, ["answer", "The picture is 0.4 s old."], ["frame", 50]]
    sent, texts, _ = run(*refused)
    assert sent[-1]["linear"] == 0
    assert texts["drive-reason"] == "The picture is 0.4 s old."
    _, texts, _ = run(*refused, ["window", "keyup", {"code": "KeyW"}], W)
    assert texts["drive-reason"] == ""


def test_a_page_that_may_not_drive_shows_why_beside_its_button() -> None:
    _, texts, _ = run(["begin"], ["closed", "Another page drives."])
    assert texts["drive-ended"] == "Another page drives."


def test_a_page_that_asks_sends_zero_whatever_is_held_until_it_drives() -> None:
    sent, texts, _ = run(*ASKS, ["frame", 50], W, ["frame", 250])
    assert len(sent) > 2
    assert {(one["linear"], one["angular"]) for one in sent} == {(0, 0)}
    assert texts["drive-turn"] == "Wait for Anna."


@pytest.mark.parametrize("hold", [[W], PULLED, [touch("enable", 1), touch("stick", 2)]])
def test_what_is_held_when_a_page_gets_the_wheel_must_be_pressed_again(hold: list[Step]) -> None:
    waits: list[Step] = [*ASKS, *hold, ["frame", 250]]
    assert newest(*hold, ["frame", 50]) == 1
    sent, texts, _ = run(*waits, TURN, ["frame", 250], ["frame", 250])
    assert {(one["linear"], one["angular"]) for one in sent} == {(0, 0)}
    assert texts["drive-reason"] == "You drive now: let go, and press again."
    assert run(*waits, TURN, ["frame", 250], ["window", "keyup", {"code": "KeyW"}], W)[0][-1]["linear"] == 1


def test_a_gamepad_that_is_held_when_a_page_gets_the_wheel_must_be_released() -> None:
    taken = [*ASKS, *pad(held=False), *pad(held=True), TURN, *pad(held=True)]
    assert {one["linear"] for one in run(*taken)[0]} == {0}
    assert run(*taken, *pad(held=False), *pad(held=True))[0][-1]["linear"] == 1


def test_a_hand_over_names_the_person_who_is_shown_and_sends_a_zero_before_it_in_the_same_event() -> None:
    asked: list[Step] = [*BEGUN, W, ["turn", True, "Ben", "Ben asks to drive."]]
    sent, texts, _ = run(*asked, ["on", "hand-over", "click", {}])
    assert [one.get("linear") for one in sent[-3:]] == [1, 0, None]
    assert sent[-1] == {"hand_over": "Ben"}
    assert texts["drive-turn"] == "Ben asks to drive."


def test_the_button_names_who_drives() -> None:
    assert run(["begin"], ["driver", "Anna"])[1]["drive-begin"] == "Anna drives. Ask to drive"
    assert run(["begin"], ["driver", ""])[1]["drive-begin"] == "Drive"


def picture(number: int, **more: str) -> Step:
    velocity = dict.fromkeys(("requested", "permitted", "measured"), 0)
    texts = dict.fromkeys(("mode", "why", "step", "own_step", "owner", "nearest"), "") | more
    facts: dict[str, Any] = {
        "scans": [],
        "ghost": None,
        "stop": None,
        "age_s": 0.1,
        "round_trip_s": 0.1,
        "events": [],
    }
    return ["shown", {"kind": "picture", "number": number, "velocity": velocity, **texts, **facts}]


LINES = {name: [0, 0, 10, 10] for name in ("outline", "heading", "stop", "warning")}
ROBOT: Step = ["shown", {"kind": "robot", "most_m_s": 1, "source": "teleop", **LINES}]


@pytest.mark.parametrize(
    ("owner", "driver", "shown"),
    [("teleop", "Anna", "Anna"), ("teleop", "", "teleop"), ("nav", "Anna", "nav")],
)
def test_the_person_who_drives_is_named_instead_of_the_source_of_the_pages(
    owner: str, driver: str, shown: str
) -> None:
    begun: list[Step] = [["driver", driver], ["pictures"], ROBOT, picture(1, owner=owner), ["frame", 50]]
    assert f"driven by {shown}\n" in run(*begun)[1]["facts"]


def test_a_page_shows_its_driver_what_to_do_at_this_page() -> None:
    stopped: list[Step] = [ROBOT, picture(1, step="the driver lets go", own_step="let go"), ["frame", 50]]
    for begun, step in (
        ([*BEGUN, ["pictures"]], "→ let go"),
        ([["begin"], ["pictures"]], "→ the driver lets go"),
    ):
        assert run(*begun, *stopped)[1]["facts"].splitlines()[0] == step


def test_only_a_picture_that_is_large_enough_to_be_seen_counts_as_drawn() -> None:
    begun: list[Step] = [["pictures"], ROBOT, picture(1), ["frame", 50]]
    sent, _, drawn = run(*begun)
    assert (sent[-1], drawn) == ({"drawn": 1}, 1)
    sent, _, drawn = run(*begun, ["map", 0], picture(2), ["frame", 50])
    assert (sent[-1], drawn) == ({"drawn": 2}, 0)


def test_a_picture_that_a_slow_link_brings_late_is_not_shown_as_new() -> None:
    """The server makes a picture after the page has drawn the one before, so it is no older than that."""
    first: list[Step] = [["pictures"], ROBOT, picture(1), ["frame", 50]]
    assert run(*first)[1]["isPictureShown"] == "true"
    assert run(*first, ["frame", 900], picture(2), ["frame", 50])[1]["isPictureShown"] == "true"
    late: list[Step] = [*first, ["frame", 2900], picture(2), ["frame", 50]]
    sent, texts, _ = run(*late)
    assert (sent[-1], texts["isPictureShown"]) == ({"drawn": 2}, "false")
    assert run(*late, picture(3), ["frame", 50])[1]["isPictureShown"] == "true"


@pytest.mark.parametrize(("code", "connections"), [(4429, 2), (1006, 2), (4404, 1)])
def test_pictures_that_end_begin_again_unless_the_station_shows_none(code: int, connections: int) -> None:
    _, texts, _ = run(["pictures"], ["closed", "", code], ["frame", 500])
    assert texts["sockets"].split() == ["ws://x/picture"] * connections
