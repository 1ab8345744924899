// The page's side of the lease with the supervisor. Pure: times are arguments, in seconds of one monotonic clock.
//
// The page answers each challenge of the supervisor, and challenges it in return. It is heard while the supervisor answers: the
// supervisor answers only what it accepted. teleop/station/state.py has the same functions; a test compares them.

export const LEASE_S = 0.3; // wire/lease.py
export const PRESENCE_PERIOD_S = 0.1;

export const NEW = {
  challenges: [], // its own that have not expired
  heard_s: -Infinity, // when the newest of its challenges was issued that the supervisor answered
  response: "0", // the newest challenge of the supervisor
  isStopped: false, // whether the supervisor's newest answer reports a latched e-stop
  sent_s: -Infinity,
  pressed_s: Infinity, // when the button was pressed; infinite while it is not
};

export const isPressed = (lease) => lease.pressed_s < Infinity;

// Whether the supervisor has accepted a message that said that the button is pressed. While another page holds the lease, the
// supervisor accepts no message of this page; then a later status must show the e-stop (isSeen).
export const isConfirmed = (lease, isSeen = false) => lease.heard_s >= lease.pressed_s || (isSeen && isPressed(lease));

export const isHeard = (lease, now_s) => now_s - lease.heard_s <= LEASE_S;

export const dueAt_s = (lease) => lease.sent_s + PRESENCE_PERIOD_S;

// The button stays pressed until it is released.
export const pressed = (lease, now_s) => (isPressed(lease) ? lease : { ...lease, pressed_s: now_s });

// Without the supervisor's confirmation, it stays pressed.
export const released = (lease, isSeen = false) => (isConfirmed(lease, isSeen) ? { ...lease, pressed_s: Infinity } : lease);

// After the loss of the connection, only the button is still known.
export const disconnected = (lease) => ({ ...NEW, pressed_s: lease.pressed_s });

// A message that answers no unexpired challenge proves nothing about this page.
export function received(lease, message) {
  const answered = lease.challenges.find((one) => one.number === message.response);
  const next = { ...lease, response: message.challenge };
  if (answered === undefined || answered.issued_s < lease.heard_s) return next;
  return { ...next, heard_s: answered.issued_s, isStopped: message.stop };
}

// Returns the lease after a message that is sent now, and the message. `challenge` is a random number, as text.
export function sent(lease, challenge, now_s) {
  const kept = lease.challenges.filter((one) => now_s - one.issued_s <= LEASE_S);
  const challenges = [...kept, { number: challenge, issued_s: now_s }];
  const message = { challenge, response: lease.response, stop: isPressed(lease) };
  return [{ ...lease, challenges, sent_s: now_s }, message];
}
