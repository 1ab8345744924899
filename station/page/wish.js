// What the hands at the page want. Pure: each event gives the next state, and any doubt gives zero.
//
// Motion lasts only while something is held: a stick with the mouse, a stick and the enable button with two thumbs, keys, or a
// gamepad with its dead-man button. With two of these at the same time, the wish is zero, and both must be pressed again: the
// release of one must not begin the motion of the other. Among keys, the others still count when one is released.

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

// freePad: the number of the gamepad that was seen with its dead-man button released since everything was last forgotten.
// down: the driving keys whose release was not seen since they were pressed, whether or not they count.
export const NOTHING = { enable: null, stick: null, keys: [], pad: null, freePad: null, down: [] };

export const forgotten = (wish) => ({ ...NOTHING, down: wish.down });

export const isHeld = (wish) =>
  wish.enable !== null || wish.stick !== null || wish.keys.length > 0 || wish.pad !== null;

export const areTwoHeld = (wish) =>
  [wish.stick !== null, wish.keys.length > 0, wish.pad !== null].filter(Boolean).length > 1;

export const isDriveKey = (code) => code in KEYS;

export const enabled = (wish, pointer) => ({ ...wish, enable: pointer });

// x: to the right, y: up, from -1 to 1.
export const pulled = (wish, pointer, x, y, isTouch) => ({ ...wish, stick: { pointer, x, y, isTouch } });

export const moved = (wish, pointer, x, y) =>
  wish.stick?.pointer === pointer ? { ...wish, stick: { ...wish.stick, x, y } } : wish;

// After the release of the enable button, the stick must be touched again, too.
export function lifted(wish, pointer) {
  if (wish.enable === pointer) return forgotten(wish);
  return wish.stick?.pointer === pointer ? { ...wish, stick: null } : wish;
}

// A browser may report a held key as newly pressed, as after it had no focus: a press counts only after the release was seen.
export function keyHeld(wish, code, counts) {
  if (!isDriveKey(code) || wish.down.includes(code)) return wish;
  return { ...wish, down: [...wish.down, code], keys: counts ? [...wish.keys, code] : wish.keys };
}

export function keyLifted(wish, code) {
  const others = (codes) => codes.filter((one) => one !== code);
  return { ...wish, keys: others(wish.keys), down: others(wish.down) };
}

// index: the number of the gamepad; buttons: whether each is pressed; axes: from -1 to 1, the first to the right, the second down.
// A gamepad is read at each frame: a button that is still held, or is held on another gamepad, must be released before it counts.
export function padRead(wish, pad) {
  const isPressed = pad !== null && pad.buttons[DEAD_MAN] === true;
  if (isPressed && wish.freePad === pad.index) return { ...wish, pad: { x: pad.axes[0] ?? 0, y: -(pad.axes[1] ?? 0) } };
  const freePad = pad === null || isPressed ? null : pad.index;
  return wish.pad === null && wish.freePad === freePad ? wish : { ...wish, pad: null, freePad };
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
  if (areTwoHeld(wish)) return [0, 0];
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
