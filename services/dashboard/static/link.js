// The WebSocket: takes frames apart, answers each with its number, and comes back by itself.
export const STALE_MS = 1000;

export function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const { count } = header.columns;
  let at = 4 + length;
  const columns = {};
  for (const row of header.rows) {
    columns[row] = new Float32Array(buffer, at, count);
    at += 4 * count;
  }
  return { header, columns, levels: new Uint8Array(buffer, at) };
}

export function connect(path, onFrame, onLink) {
  let wait = 200;
  const open = () => {
    const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${path}`);
    let last = performance.now();
    const watch = setInterval(() => {
      if (performance.now() - last > 4000) socket.close();
    }, 500);
    socket.binaryType = "arraybuffer";
    socket.onmessage = (message) => {
      last = performance.now();
      wait = 200;
      const frame = decode(message.data);
      socket.send(String(frame.header.frame));
      onLink(true);
      onFrame(frame);
    };
    socket.onclose = () => {
      clearInterval(watch);
      onLink(false);
      setTimeout(open, wait);
      wait = Math.min(2 * wait, 2000);
    };
  };
  open();
}
