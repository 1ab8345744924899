// The page of an e-stop station: one button, and whether the robot hears it. It cannot drive.
//
// The lease is held from this loop: a page that hangs, hides or closes is not heard, and the server sends nothing in its place.

import * as leases from "./lease.js";

const TURN_S = 0.05;
const RETRY_S = 0.5;
const RELEASE_S = 1;
const HANGS_S = 1;
const NOT_PAIRED = 4401;
const NO_STOP_KEYS = /^(Tab|Shift|Control|Alt|AltGraph|Meta|CapsLock|NumLock|F\d+)$/;

const element = (id) => document.getElementById(id);
const now_s = () => performance.now() / 1000;

let lease = leases.NEW;
let socket = null;
let isWelcome = false;
let code = ""; // from the address, for one use
let token = ""; // of the session; only this page has it
let station = "";
let view = { problem: "", reasons: "", latched: false, required: false };
let ending = ""; // why the last connection has ended
let confirmedAfter_s = NaN;

// --- the connection

function takeCode() {
  if (location.hash.length < 2) return;
  code = decodeURIComponent(location.hash.slice(1));
  history.replaceState(null, "", location.pathname);
}

function connect() {
  if (socket !== null || document.hidden || (code === "" && token === "")) return;
  const own = (socket = new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/lease`));
  own.onopen = () => {
    own.send(JSON.stringify(code === "" ? { token } : { code }));
    code = "";
  };
  own.onmessage = (event) => own === socket && onMessage(JSON.parse(event.data));
  own.onclose = (event) => own === socket && onClose(event.code, event.reason);
}

function onMessage(message) {
  if (message.kind === "welcome") {
    ({ station, token } = message);
    isWelcome = true;
    send();
  } else if (message.kind === "lease") {
    lease = leases.received(lease, message);
    if (leases.isPressed(lease) && leases.isConfirmed(lease) && Number.isNaN(confirmedAfter_s)) {
      confirmedAfter_s = now_s() - lease.pressed_s;
    }
    send();
  } else {
    view = message;
  }
  render();
}

function onClose(number, reason) {
  socket = null;
  isWelcome = false;
  lease = leases.disconnected(lease);
  ending = reason;
  if (number === NOT_PAIRED) token = "";
  else setTimeout(connect, RETRY_S * 1000);
  render();
}

// The lease ends with the connection, at once.
function disconnect(why) {
  if (socket === null) return;
  const own = socket;
  onClose(0, why);
  own.close();
}

function send() {
  const random = crypto.getRandomValues(new BigUint64Array(1))[0];
  const [next, message] = leases.sent(lease, String((random >> 1n) + 1n), now_s());
  lease = next;
  if (isWelcome && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

// --- the button

function press(event) {
  event.preventDefault();
  if (!leases.isPressed(lease)) confirmedAfter_s = NaN;
  lease = leases.pressed(lease, now_s());
  send();
  render();
}

element("stop").addEventListener("pointerdown", press);
element("stop").addEventListener("click", press); // of assistive technology, which sends no other event
addEventListener("keydown", (event) => {
  if (event.target === element("release") || event.ctrlKey || event.altKey || event.metaKey) return;
  if (!event.repeat && !NO_STOP_KEYS.test(event.key)) press(event);
});

let releasing = 0;
function beginRelease(event) {
  if (event.repeat || (event.type === "keydown" && event.key !== " " && event.key !== "Enter")) return;
  event.stopPropagation();
  clearTimeout(releasing);
  element("release").classList.add("held");
  releasing = setTimeout(() => {
    endRelease();
    lease = leases.released(lease);
    send();
    render();
  }, RELEASE_S * 1000);
}
function endRelease() {
  clearTimeout(releasing);
  element("release").classList.remove("held");
}
for (const type of ["pointerdown", "keydown"]) element("release").addEventListener(type, beginRelease);
for (const type of ["pointerup", "pointerleave", "pointercancel", "keyup", "blur"]) {
  element("release").addEventListener(type, endRelease);
}
addEventListener("contextmenu", (event) => event.preventDefault()); // of a long touch

// --- what it shows

function word(at_s) {
  if (!leases.isHeard(lease, at_s)) return "NOT HEARD";
  return lease.isStopped ? "STOPPED" : "HEARD";
}

function sentence(shown) {
  if (shown === "NOT HEARD") {
    const isStopped = leases.isConfirmed(lease) || view.latched;
    const press = !leases.isPressed(lease) ? "" : isStopped ? "Pressed, and the robot is stopped. " : "PRESSED, not confirmed. ";
    return press + whyNotHeard();
  }
  if (leases.isPressed(lease)) {
    if (!leases.isConfirmed(lease) || shown !== "STOPPED") return "Pressed: waiting for the confirmation.";
    return `Stopped from here, confirmed after ${Math.round(confirmedAfter_s * 1000)} ms.`;
  }
  if (shown === "STOPPED") return `The robot is stopped: ${view.reasons || "e-stop"}.`;
  return view.required ? "Touch anywhere to stop. Closing or hiding this page stops the robot, too." : "Touch anywhere to stop.";
}

function whyNotHeard() {
  if (isWelcome) return `${view.problem}.`;
  if (socket === null && code === "" && token === "") return ending || "Not paired: open the address with its code.";
  return ending || "No connection to the station's program.";
}

const alarm = element("hangs").animate([{ opacity: 0 }, { opacity: 0, offset: 0.999 }, { opacity: 1 }], {
  duration: HANGS_S * 1000,
  fill: "forwards",
});

function render() {
  const shown = word(now_s());
  alarm.currentTime = 0; // it runs outside this loop, and covers the page unless it is set back
  document.body.dataset.word = shown;
  document.body.dataset.pressed = leases.isPressed(lease);
  document.title = station === "" ? shown : `${station}: ${shown}`;
  element("word").textContent = shown;
  element("sentence").textContent = sentence(shown);
  element("release").hidden = !(leases.isPressed(lease) && leases.isConfirmed(lease) && shown === "STOPPED");
}

function turn() {
  if (now_s() >= leases.dueAt_s(lease)) send();
  render();
}

// --- the page's own life

function onVisibility() {
  if (document.hidden) {
    disconnect("hidden");
  } else {
    connect();
    // Keeps the screen on; browsers refuse it without TLS, or when the battery is low.
    navigator.wakeLock?.request("screen").catch(() => {});
  }
}

document.addEventListener("visibilitychange", onVisibility);
addEventListener("pagehide", () => disconnect("closed"));
document.addEventListener("freeze", () => disconnect("frozen"));
addEventListener("pageshow", onVisibility);
addEventListener("hashchange", () => {
  takeCode();
  disconnect("a new code");
  connect();
});

takeCode();
onVisibility();
setInterval(turn, TURN_S * 1000);
render();
