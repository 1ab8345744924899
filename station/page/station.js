// The page of an e-stop station: one button, and whether the robot hears it.
//
// The lease is held from this loop: a page that hangs, hides or closes is not heard, and the server sends nothing in its place.

import { connection, element, nameOfPerson, now_s, write } from "./browser.js";
import * as leases from "./lease.js";
import * as drive from "./drive.js";
import * as pictures from "./picture.js";

const TURN_S = 0.05;
const RETRY_S = 0.5;
const RELEASE_S = 1;
const HANGS_S = 1;
const SILENCE_S = 3; // the server sends more often: the connection is dead, or was never made
const NOT_PAIRED = 4401;
const NO_STOP_KEYS = /^(Tab|Shift|Control|Alt|AltGraph|Meta|CapsLock|NumLock|F\d+)$/;

const release = element("release");
const person = element("name");

let lease = leases.NEW;
let socket = null;
let isWelcome = false;
let challenge = null; // the newest of the supervisor that is not answered yet
let isAnswering = false;
let contact_s = 0; // when the server last sent a message, or the connection began
let isCovered = false; // by something else on a touch screen, which then has the focus
let code = ""; // from the address, for one use
let token = ""; // of the session; only this page has it
let station = "";
let view = { problem: "", cause: "", latched: false, seen: false, required: false };
let ending = ""; // why the last connection has ended
let confirmedAfter_s = NaN;

// --- the connection

function takeCode() {
  code = location.hash.slice(1);
  history.replaceState(null, "", location.pathname);
}

function connect() {
  if (socket !== null || document.hidden || isCovered || (code === "" && token === "")) return;
  contact_s = now_s();
  const own = (socket = connection("lease"));
  own.onopen = () => {
    own.send(JSON.stringify(code === "" ? { token } : { code }));
    code = "";
  };
  own.onmessage = (event) => own === socket && onMessage(JSON.parse(event.data));
  own.onclose = (event) => own === socket && disconnected(event.reason, event.code);
}

function onMessage(message) {
  contact_s = now_s();
  if (message.kind === "view") {
    view = message;
    drive.show(view.driver);
  } else if (message.kind === "welcome") {
    ({ station, token } = message);
    isWelcome = true;
    sendName();
    pictures.begin(token);
    drive.offer(message.may_drive ? token : "");
    change(lease);
  } else {
    challenge = message;
    if (!isAnswering) answer();
  }
}

function tell(message) {
  if (isWelcome && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function sendName() {
  tell({ name: nameOfPerson() });
}
person.addEventListener("change", sendName);

// Answers the newest challenge after a frame was drawn and the browser itself has replied: only then does the person see the
// page, and do touches reach it. The browser's own process delivers them; this loop goes on while that process hangs.
async function answer() {
  isAnswering = true;
  try {
    while (challenge !== null) {
      const [own, message] = [socket, challenge];
      challenge = null;
      await Promise.all([new Promise(requestAnimationFrame), navigator.locks.query()]);
      if (own === socket) change(leases.received(lease, message));
    }
  } finally {
    isAnswering = false;
  }
}

function disconnected(why, number = 0) {
  socket = null;
  pictures.end();
  drive.offer("");
  isWelcome = false;
  challenge = null;
  isAnswering = false; // a page that comes back from the history may get no reply any more
  lease = leases.disconnected(lease);
  view = { ...view, latched: false, seen: false };
  ending = why;
  if (number === NOT_PAIRED) token = "";
  setTimeout(connect, RETRY_S * 1000);
  render();
}

// The lease ends with the connection, at once.
function disconnect(why) {
  const own = socket;
  disconnected(why);
  own?.close();
}

// The supervisor learns of each change in the same event.
function change(next) {
  const random = crypto.getRandomValues(new BigUint64Array(1))[0];
  const [after, message] = leases.sent(next, String(random), now_s());
  if (!leases.isConfirmed(lease) && leases.isConfirmed(after)) confirmedAfter_s = now_s() - after.pressed_s;
  lease = after;
  tell(message);
  render();
}

// --- the button

function press(event) {
  event.preventDefault();
  drive.letGo("The e-stop was pressed: release it, then press Reset.");
  letGo();
  uncovered(); // touches reach the page
  if (document.activeElement === person) sendName(); // it is still being entered
  // Somebody may have reset the e-stop since it was pressed here. A click follows its own touch.
  if (leases.isPressed(lease) && event.detail === 0) tell({ press: true });
  view = { ...view, seen: false };
  change(leases.pressed(lease, now_s()));
}

element("stop").addEventListener("pointerdown", press);
element("stop").addEventListener("click", press); // of assistive technology, which sends no other event
addEventListener("keydown", (event) => {
  if (event.repeat || event.target === release || event.target === person || event.ctrlKey || event.altKey || event.metaKey) return;
  if (!NO_STOP_KEYS.test(event.key) && !drive.takes(event)) press(event);
});
// If a control is hidden while a finger is on it, the lift of the finger would click the e-stop below.
addEventListener("touchend", (event) => {
  if (event.target.getClientRects().length === 0) event.preventDefault();
});
addEventListener("contextmenu", (event) => event.preventDefault()); // of a long touch

let releasing = 0;
function letGo() {
  clearTimeout(releasing);
  release.classList.remove("held");
}
function hold(event) {
  if (event.repeat) return;
  letGo();
  if (event.type !== "pointerdown" && event.type !== "keydown") return;
  release.classList.add("held");
  releasing = setTimeout(() => {
    letGo();
    change(leases.released(lease, view.seen));
  }, RELEASE_S * 1000);
}
for (const type of ["pointerdown", "keydown", "pointerup", "pointerleave", "pointercancel", "keyup", "blur"]) {
  release.addEventListener(type, hold);
}

// --- what it shows

function sentence(word) {
  if (word === "NOT HEARD") {
    return pressNotHeard() + whyNotHeard();
  }
  if (leases.isPressed(lease)) {
    if (!leases.isConfirmed(lease) || word !== "STOPPED") return "Pressed: waiting for the confirmation.";
    return `Stopped from here, confirmed after ${Math.round(confirmedAfter_s * 1000)} ms.`;
  }
  if (word === "STOPPED") return `The robot is stopped${view.cause && `: ${view.cause}`}.`;
  return `Touch anywhere to stop.${view.required ? " Closing or hiding this page stops the robot, too." : ""}`;
}

// Somebody may have reset the e-stop after its confirmation: only a status shows whether the robot is stopped.
function pressNotHeard() {
  if (!leases.isPressed(lease)) return "";
  if (view.latched) return "Pressed, and the robot is stopped. ";
  return leases.isConfirmed(lease, view.seen)
    ? "Pressed and confirmed, but perhaps reset since. Touch again to stop. "
    : "PRESSED, not confirmed. ";
}

function whyNotHeard() {
  if (navigator.locks === undefined) return "This browser is too old: use a newer one.";
  if (isWelcome) return view.problem;
  if (code === "" && token === "") return ending || "Not paired: open the address with its code.";
  return ending || "No connection to the station's program: check that it runs.";
}

const alarm = element("hangs").animate([{ opacity: 0 }, { opacity: 0, offset: 0.999 }, { opacity: 1 }], {
  duration: HANGS_S * 1000,
  fill: "forwards",
});

function render() {
  alarm.currentTime = 0; // the browser runs it outside this loop, and it covers the page unless it is set back
  const word = !leases.isHeard(lease, now_s()) ? "NOT HEARD" : lease.isStopped ? "STOPPED" : "HEARD";
  release.hidden = !leases.isConfirmed(lease, view.seen);
  document.title = `${station} ${word}`;
  document.body.dataset.word = word;
  document.body.dataset.pressed = leases.isPressed(lease);
  const texts = { word, sentence: sentence(word), place: release.hidden ? station : "" };
  for (const [id, text] of Object.entries(texts)) write(id, text);
}

// --- the page's own life

function onVisibility() {
  if (document.hidden) return disconnect("The page was hidden: it connects again.");
  connect();
  navigator.wakeLock?.request("screen").catch(() => {}); // keeps the screen on, where the browser permits it
}

document.addEventListener("visibilitychange", onVisibility);
addEventListener("pageshow", onVisibility);
// What covers a page on a touch screen does not always hide it: the list of notifications, a menu, the keyboard. Touches then
// do not reach the page. With a mouse, a page without the focus can still be clicked.
addEventListener("blur", () => {
  if (!matchMedia("(pointer: coarse)").matches) return;
  isCovered = true;
  disconnect("Something else has the focus: touch the page.");
});
addEventListener("focus", uncovered);
function uncovered() {
  isCovered = false;
  connect();
}
addEventListener("pagehide", () => disconnect("The page was closed: it connects again."));
document.addEventListener("freeze", () => disconnect("The page was frozen: touch it."));
addEventListener("hashchange", () => {
  takeCode();
  disconnect("Pairing again.");
});

takeCode();
onVisibility();
setInterval(() => {
  if (socket !== null && now_s() - contact_s > SILENCE_S) disconnect("The station's program does not answer: check that it runs.");
  if (now_s() >= leases.dueAt_s(lease)) change(lease);
  else render();
}, TURN_S * 1000);
