// Drives the robot from this page while something is held. Every change goes out in its own event, and the heartbeat comes from
// the drawing of frames: a page that is hidden or hangs sends nothing, and the robot stops.

import { connection, element, nameOfPerson, now_s, write } from "./browser.js";
import { LEASE_S } from "./lease.js";
import * as pictures from "./picture.js";
import * as wishes from "./wish.js";

const BEAT_S = 0.03;
const WAIT_BEAT_S = 0.2; // while another page drives
const TWO = "Two controls are held: release both, and press one.";
const STALLED_BYTES = 2000; // of commands that the browser could not send yet

let token = ""; // empty: this page may not drive now
let socket = null;
let isTaken = false; // whether the server lets this page drive; until then, it asks, and sends zero
let asker = ""; // the name of the person who asks this page to hand over, as it is shown; empty: nobody
let wish = wishes.NOTHING;
let sent_s = -Infinity;
let sentZero = true;
let answered_s = -Infinity; // when the newest question was asked to which the browser's own process has replied
let isAsking = false;

// Called with the token of the session when the page is connected, and with an empty one when it is not.
export function offer(ofSession) {
  token = ofSession;
  if (token === "") end("");
  render();
}

// Shows who drives; empty: nobody.
export function show(driver) {
  document.body.dataset.driver = driver;
  write("drive-begin", driver === "" ? "Drive" : `${driver} drives. Ask to drive`);
}

// Whether a key drives, and therefore does not stop.
export const takes = (event) => socket !== null && wishes.isDriveKey(event.code);

// Forgets everything that is held: it must be pressed again.
export function letGo(why) {
  const wasHeld = wishes.isHeld(wish);
  wish = wishes.forgotten(wish); // also a gamepad that nobody holds: it must be seen released again
  if (!wasHeld) return;
  showReason(why);
  changed();
}

function begin() {
  if (token === "" || socket !== null) return;
  const own = (socket = connection("drive"));
  own.onopen = () => own.send(JSON.stringify({ token, name: nameOfPerson() }));
  own.onmessage = (event) => {
    if (own !== socket) return;
    const message = JSON.parse(event.data);
    if (message.kind === "turn") return onTurn(message);
    change(wishes.forgotten(wish));
    showReason(message.sentence); // it stays until something is held again
  };
  own.onclose = (event) => own === socket && end(event.reason || "The connection has ended: press Drive again.");
  showReason("");
  onTurn({ drives: false, asker: "", sentence: "" });
  answered_s = now_s();
  isAsking = false; // a page that comes back from the history may get no reply any more
  requestAnimationFrame(() => beat(own));
}

function onTurn(turn) {
  // What was held while the page asked was not meant to move the robot now; while it asks, it sends zero.
  if (turn.drives && !isTaken) letGo("You drive now: let go, and press again.");
  ({ drives: isTaken, asker } = turn);
  element("hand-over").hidden = asker === "";
  write("drive-turn", turn.sentence);
  render();
}

function end(why) {
  const own = socket;
  socket = null;
  isTaken = false;
  wish = wishes.forgotten(wish);
  own?.close();
  if (own !== null) showReason(why);
  render();
}

function beat(own) {
  if (own !== socket) return;
  requestAnimationFrame(() => beat(own));
  ask();
  const isReached = now_s() - answered_s <= LEASE_S;
  if (!isReached) letGo("The browser hangs: press again.");
  // Every page in sight reads the same gamepad: it drives the one that has the focus.
  const pads = isReached && document.hasFocus() ? navigator.getGamepads?.() : [];
  const pad = pads?.find((one) => one?.connected && one.mapping === "standard") ?? null;
  const buttons = pad?.buttons.map((one) => one.pressed);
  follow(wishes.padRead(wish, pad === null ? null : { index: pad.index, buttons, axes: pad.axes }));
  if (now_s() - sent_s >= (isTaken ? BEAT_S : WAIT_BEAT_S)) send();
}

// Keys and touches come through the browser's own process: while it hangs, this loop goes on, and does not learn of their release.
async function ask() {
  if (isAsking) return;
  isAsking = true;
  const asked_s = now_s();
  await navigator.locks.query();
  answered_s = asked_s;
  isAsking = false;
}

// Something is held or released.
function change(next) {
  if (!wishes.isHeld(wish) && wishes.isHeld(next)) showReason("");
  wish = next;
  if (wishes.areTwoHeld(wish)) letGo(TWO);
  else changed();
}

function changed() {
  send();
  render();
}

// What is held has moved. Only its zero goes out at once: a hand may move more often than the server accepts.
function follow(next) {
  if (next === wish) return;
  wish = next;
  if (wishes.areTwoHeld(wish)) return letGo(TWO);
  if (!sentZero && wanted().every((one) => one === 0)) send();
  render();
}

const wanted = () => wishes.wanted(wish, Number(element("speed").value));

function send() {
  if (socket?.readyState !== WebSocket.OPEN) return;
  if (socket.bufferedAmount > STALLED_BYTES) return end("The link is too slow: press Drive again.");
  sent_s = now_s();
  const [linear, angular] = isTaken ? wanted() : [0, 0];
  sentZero = linear === 0 && angular === 0;
  socket.send(JSON.stringify({ linear, angular, time_s: sent_s, picture: pictures.drawn() }));
}

// --- the hands

function placeOf(event) {
  const box = element("stick").getBoundingClientRect();
  const half = Math.min(box.width, box.height) / 2;
  return [(event.clientX - box.x - box.width / 2) / half, -(event.clientY - box.y - box.height / 2) / half];
}

const FINGER = "Another finger touched: let go, and press again.";

// A further finger anywhere, before what else it does.
function furtherFinger() {
  if (wish.stick !== null && (wish.enable !== null || !wish.stick.isTouch)) letGo(FINGER);
}
addEventListener("pointerdown", furtherFinger, true);

element("enable").addEventListener("pointerdown", (event) => {
  event.preventDefault();
  if (event.button !== 0) return;
  if (wish.enable !== null) return letGo(FINGER);
  element("enable").setPointerCapture(event.pointerId);
  change(wishes.enabled(wish, event.pointerId));
});

element("stick").addEventListener("pointerdown", (event) => {
  event.preventDefault();
  if (event.button !== 0) return;
  if (wish.stick !== null) return letGo(FINGER);
  element("stick").setPointerCapture(event.pointerId);
  change(wishes.pulled(wish, event.pointerId, ...placeOf(event), event.pointerType !== "mouse"));
});

function lift(event) {
  const next = wishes.lifted(wish, event.pointerId);
  if (next === wish) return;
  const why = wish.enable === event.pointerId && wish.stick !== null ? "Hold to drive was released: touch both again." : "";
  showReason(why);
  change(next);
}

addEventListener("pointermove", (event) => {
  // A mouse whose left button is released while another one is pressed only moves.
  if ((event.buttons & 1) === 0) lift(event);
  follow(wishes.moved(wish, event.pointerId, ...placeOf(event)));
});

for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) addEventListener(type, lift);

addEventListener("keydown", (event) => {
  // While a Mac's command key is pressed, the release of another key is not reported.
  const isModified = event.ctrlKey || event.altKey || event.metaKey;
  const wasDown = wish.down.includes(event.code) && !wish.keys.includes(event.code);
  keep(wishes.keyHeld(wish, event.code, takes(event) && !isModified && !event.repeat));
  if (isModified) return letGo("Another key was pressed: press again.");
  if (!takes(event)) return;
  event.preventDefault();
  if (wasDown && !event.repeat) showReason("The page has not seen the key's release: release it, and press again.");
});
addEventListener("keyup", (event) => keep(wishes.keyLifted(wish, event.code)));

// Keys that do not count send nothing.
function keep(next) {
  if (next.keys.length === wish.keys.length) wish = next;
  else change(next);
}

addEventListener("blur", () => letGo("Something else has the focus: press again."));
document.addEventListener("visibilitychange", () => letGo("The page was hidden: press again."));
addEventListener("resize", () => letGo("The page changed its size: press again."));
addEventListener("gamepaddisconnected", () => letGo("The gamepad was lost: connect it, and press again."));

function request(message) {
  letGo(""); // its zero goes out before
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

element("drive-begin").addEventListener("click", begin);
element("reset").addEventListener("click", () => {
  showReason("");
  request({ request: "reset" });
});
element("hand-over").addEventListener("click", () => request({ hand_over: asker }));
element("drive-end").addEventListener("click", () => {
  letGo("");
  end("");
});

// --- what it shows

function showReason(sentence) {
  for (const id of ["drive-reason", "drive-ended"]) write(id, sentence);
}

function render() {
  element("drive-offer").hidden = token === "" || socket !== null;
  element("drive").hidden = socket === null;
  document.body.dataset.driving = socket !== null;
  document.body.dataset.drives = isTaken;
  element("enable").dataset.held = wish.enable !== null;
  const pull = wish.stick ?? { x: 0, y: 0 };
  const length = Math.max(1, Math.hypot(pull.x, pull.y));
  element("knob").style.translate = `${(100 * pull.x) / length}% ${(-100 * pull.y) / length}%`;
}
