// What the hands at the page want. Pure: each event gives the next state, and any doubt gives zero.
//
// Motion lasts only while something is held: a stick with the mouse, a stick and the enable button with two thumbs, keys, or a
// gamepad with its dead-man button. Only one of them counts: with two at the same time, the wish is zero.

const KEYS = {
  KeyW: [1, 0],
  ArrowUp: [1, 0],
  KeyS: [-1, 0],
  ArrowDown: [-1, 0],
  KeyA: [0, 1],
  ArrowLeft: [0, 1],
  KeyD: [0, -1],
  ArrowRight: [0, -1],
};
const DEAD_ZONE = 0.15;
const LEVELS = 5;
const DEAD_MAN = 4; // left shoulder button, in the standard mapping

// isPadFree: whether the gamepad was seen with its dead-man button released since everything was last forgotten.
export const NOTHING = { enable: null, stick: null, keys: [], pad: null, isPadFree: false };

export const isHeld = (wish) =>
  wish.enable !== null || wish.stick !== null || wish.keys.length > 0 || wish.pad !== null;

export const isDriveKey = (code) => code in KEYS;

export const enabled = (wish, pointer) => ({ ...wish, enable: pointer });

// x: to the right, y: up, from -1 to 1.
export const pulled = (wish, pointer, x, y, isTouch) => ({ ...wish, stick: { pointer, x, y, isTouch } });

export const moved = (wish, pointer, x, y) =>
  wish.stick?.pointer === pointer ? { ...wish, stick: { ...wish.stick, x, y } } : wish;

export const lifted = (wish, pointer) => ({
  ...wish,
  enable: wish.enable === pointer ? null : wish.enable,
  stick: wish.stick?.pointer === pointer ? null : wish.stick,
});

export const keyHeld = (wish, code) =>
  isDriveKey(code) && !wish.keys.includes(code) ? { ...wish, keys: [...wish.keys, code] } : wish;

export const keyLifted = (wish, code) => ({ ...wish, keys: wish.keys.filter((one) => one !== code) });

// buttons: whether each is pressed; axes: from -1 to 1, the first to the right, the second down.
// A gamepad is read again and again: a button that is still held must be released before it counts again.
export function padRead(wish, pad) {
  const isPressed = pad !== null && pad.buttons[DEAD_MAN] === true;
  if (isPressed && wish.isPadFree) return { ...wish, pad: { x: pad.axes[0] ?? 0, y: -(pad.axes[1] ?? 0) } };
  const isPadFree = pad !== null && !isPressed;
  return wish.pad === null && wish.isPadFree === isPadFree ? wish : { ...wish, pad: null, isPadFree };
}

const clamp = (value) => Math.max(-1, Math.min(1, Number.isFinite(value) ? value : 0));

function ofStick(x, y) {
  const length = Math.hypot(x, y);
  if (!(length > DEAD_ZONE)) return [0, 0];
  const share = Math.min(1, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length;
  return [clamp(y * share), clamp(-x * share)];
}

// Returns the shares of the largest velocity and rate, at a speed level from 1 to 5.
export function wanted(wish, level) {
  const held = [wish.stick !== null, wish.keys.length > 0, wish.pad !== null];
  if (held.filter(Boolean).length !== 1) return [0, 0];
  if (wish.stick?.isTouch && (wish.enable === null || wish.enable === wish.stick.pointer)) return [0, 0];
  const keys = wish.keys.map((code) => KEYS[code]);
  const pull = wish.stick ?? wish.pad;
  const [linear, angular] =
    pull !== null
      ? ofStick(pull.x, pull.y)
      : [clamp(keys.reduce((sum, key) => sum + key[0], 0)), clamp(keys.reduce((sum, key) => sum + key[1], 0))];
  const share = clamp(level / LEVELS);
  return [linear * share || 0, angular * share || 0]; // no negative zero
}
