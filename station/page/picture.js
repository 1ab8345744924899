// The robot from above, and its velocities of the last 20 s. It shows; nothing here stops or drives the robot.
//
// The server sends the next picture when this one is drawn. Places are in the base frame, in centimetres: x ahead, y to the left.

import { connection, element, now_s, write } from "./browser.js";

const CHART_S = 20;
const NEAR_CM = 250; // seen around the hull
const LEAST_PX = 20;
const RETRY_MS = 500;
const NO_PICTURE = 4404; // this station shows none
const LATE_S = 1; // a picture that was asked for longer ago is hidden
const NAMES = ["requested", "permitted", "measured"];
const INKS = {
  light: { ground: "#f4f4f4", free: "#cfe6d8", line: "#101010", far: "#303030", hidden: "#8a3fc0", ghost: "#0a52c8" },
  dark: { ground: "#16191d", free: "#1f3a2b", line: "#f4f4f4", far: "#c8ced6", hidden: "#c58bea", ghost: "#6ea8ff" },
};
const WARNING = "#d98200";
const STOP = "#e0301e";

const canvas = element("map");
const dark = matchMedia("(prefers-color-scheme: dark)");

let token = ""; // of the session; empty: no pictures
let socket = null;
let robot = null;
let asked_s = -Infinity; // when the next picture was asked for: the server makes it after this, so it is no older
let shown_s = -Infinity; // when the newest picture was asked for
let number = 0; // of the newest picture that was submitted for drawing; 0 if none is seen
let chart = []; // [time, requested, permitted, measured] of the straight velocity

export const drawn = () => number;

export function begin(ofSession) {
  end();
  token = ofSession;
  connect();
}

export function end() {
  token = "";
  lose();
}

function connect() {
  if (token === "" || socket !== null) return;
  asked_s = now_s();
  const own = (socket = connection("picture"));
  own.onopen = () => own.send(JSON.stringify({ token }));
  own.onmessage = (event) => own === socket && onMessage(JSON.parse(event.data));
  own.onclose = (event) => {
    if (own !== socket) return;
    lose();
    // The server may not have noticed yet that the one before has ended.
    if (event.code !== NO_PICTURE) setTimeout(connect, RETRY_MS);
  };
}

function lose() {
  const own = socket;
  socket = null;
  robot = null;
  chart = [];
  number = 0;
  show(false);
  own?.close();
}

function onMessage(message) {
  if (message.kind === "robot") {
    robot = message;
    write("passport", robot.passport);
    return;
  }
  const own = socket;
  requestAnimationFrame(() => {
    if (own !== socket) return;
    shown_s = asked_s;
    show(now_s() - shown_s <= LATE_S);
    describe(message);
    number = draw(message) ? message.number : 0;
    asked_s = now_s();
    own.send(JSON.stringify({ drawn: message.number }));
  });
}

function show(isShown) {
  element("picture").hidden = !isShown;
  document.body.dataset.picture = isShown;
}

setInterval(() => {
  if (now_s() - shown_s > LATE_S) show(false);
}, 200);

// --- drawing

// Returns whether there is enough room for it to be seen.
function draw(picture) {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (width < LEAST_PX || height < LEAST_PX) return false;
  const dots = devicePixelRatio;
  if (canvas.width !== Math.round(width * dots) || canvas.height !== Math.round(height * dots)) {
    canvas.width = Math.round(width * dots);
    canvas.height = Math.round(height * dots);
  }
  const ink = dark.matches ? INKS.dark : INKS.light;
  const pen = canvas.getContext("2d");
  const chart_px = Math.min(70, height * 0.2);
  const reach_cm = Math.max(...robot.warning.map(Math.abs)) + NEAR_CM;
  const scale = Math.min(width, height - chart_px) / 2 / reach_cm;
  pen.setTransform(dots, 0, 0, dots, 0, 0);
  pen.fillStyle = ink.ground;
  pen.fillRect(0, 0, width, height);
  // Ahead is up.
  pen.setTransform(0, -dots * scale, -dots * scale, 0, (dots * width) / 2, (dots * (height - chart_px)) / 2);
  for (const scan of picture.scans) fill(pen, scan.free, ink.free);
  line(pen, robot.warning, WARNING, 1 / scale, [4 / scale, 4 / scale]);
  line(pen, robot.stop, STOP, 1.5 / scale);
  for (const scan of picture.scans) {
    points(pen, scan.hidden, () => ink.hidden, 1.5 / scale);
    points(pen, scan.points, (place) => [ink.far, WARNING, STOP, STOP][scan.classes[place]], 1.8 / scale);
  }
  const [x, y, yaw] = picture.ghost ?? [0, 0, 0];
  if (Math.hypot(x, y) > 1 || Math.abs(yaw) > 0.02) {
    pen.save();
    pen.translate(x, y);
    pen.rotate(yaw);
    line(pen, robot.outline, ink.ghost, 2.5 / scale, [6 / scale, 3 / scale]);
    pen.restore();
  }
  line(pen, robot.outline, ink.line, 2 / scale);
  line(pen, robot.heading, ink.line, 2 / scale);
  pen.setTransform(dots, 0, 0, dots, 0, 0);
  const top = height - chart_px;
  line(pen, [12, top - 12, 12 + 100 * scale, top - 12], ink.line, 2);
  letter(pen, "1 m", 12, top - 17, ink.line);
  drawChart(pen, picture.velocity, top, width, chart_px, ink);
  return true;
}

function trace(pen, places) {
  pen.beginPath();
  for (let place = 0; place < places.length; place += 2) pen.lineTo(places[place], places[place + 1]);
}

function fill(pen, places, colour) {
  trace(pen, places);
  pen.fillStyle = colour;
  pen.fill();
}

function line(pen, places, colour, width, dashes = []) {
  trace(pen, places);
  pen.strokeStyle = colour;
  pen.lineWidth = width;
  pen.setLineDash(dashes);
  pen.stroke();
  pen.setLineDash([]);
}

function points(pen, places, colourOf, radius) {
  for (let place = 0; place < places.length; place += 2) {
    pen.fillStyle = colourOf(place / 2);
    pen.fillRect(places[place] - radius, places[place + 1] - radius, 2 * radius, 2 * radius);
  }
}

function letter(pen, text, x, y, colour) {
  pen.font = "12px system-ui, sans-serif";
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
}

function drawChart(pen, velocity, top, width, height, ink) {
  const time_s = now_s();
  chart.push([time_s, ...NAMES.map((name) => velocity[name] ?? NaN)]);
  while (time_s - chart[0][0] > CHART_S) chart.shift();
  const middle = top + height / 2;
  const up = (height / 2 - 6) / robot.most_m_s;
  pen.fillStyle = ink.ground; // covers the map below the chart
  pen.fillRect(0, top, width, height);
  line(pen, [0, middle, width, middle], ink.line, 0.5);
  const inks = [ink.far, ink.ghost, WARNING];
  NAMES.forEach((name, number) => {
    const across = (row) => width * (1 - (time_s - row[0]) / CHART_S);
    const places = chart.flatMap((row) => [across(row), middle - up * row[number + 1]]);
    line(pen, places, inks[number], [1, 3, 1.5][number]);
    letter(pen, name, 8 + 84 * number, top + 11, inks[number]);
  });
}

// --- the same in words

function describe(picture) {
  const { mode, why, owner, nearest, velocity, stop, age_s, round_trip_s, events } = picture;
  const metres = (cm) => `${(cm / 100).toFixed(2)} m`;
  const { driver, drives } = document.body.dataset;
  const who = owner === robot.source && driver ? driver : owner;
  const step = drives === "true" ? picture.own_step : picture.step;
  const speed = velocity.measured ?? 0;
  const ghost_cm = Math.hypot(...(picture.ghost ?? [0, 0]).slice(0, 2));
  const rows = [
    [mode, who && `driven by ${who}`, why, step && `→ ${step}`],
    [`${speed.toFixed(2)} m/s`, nearest && `nearest ${nearest}`],
    [
      ghost_cm > 1 && `if the link dies now: ${metres(ghost_cm)} (dashed)`,
      stop && `last stop ${metres(stop[0])}, ghost ${metres(stop[1])}`,
    ],
    [
      `limit ${robot.most_m_s} m/s`,
      age_s === null ? "no scan" : `scan ${Math.round(1000 * age_s)} ms old`,
      `round trip ${Math.round(1000 * round_trip_s)} ms`,
    ],
  ];
  write("facts", rows.map((row) => row.filter(Boolean).join(" · ")).join("\n"));
  write("events", events.map(([ago_s, text]) => `${Math.round(ago_s)} s ago: ${text}`).join("\n"));
}
