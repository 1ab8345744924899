// What the other scripts share.

export const element = (id) => document.getElementById(id);
export const now_s = () => performance.now() / 1000;

// A screen reader would also speak an equal text.
export function write(id, text) {
  if (element(id).textContent !== text) element(id).textContent = text;
}

// An input method may enter more than the field permits, and the server refuses a longer name.
export function nameOfPerson() {
  const { value, maxLength } = element("name");
  return [...value].slice(0, maxLength).join("");
}

export const connection = (path) =>
  new WebSocket(`${location.protocol.replace("http", "ws")}//${location.host}/${path}`);
