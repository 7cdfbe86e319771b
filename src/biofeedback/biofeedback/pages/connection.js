// The WebSocket of a page: the newest frame and state, commands and their answers, and connecting again after a loss.

const RETRY = 500; // ms; a node that restarts is back within seconds

export class Connection {
  // on: {frame, state, traces, answer, lost}, each a function of the message.
  constructor(role, on) {
    this.role = role;
    this.on = on;
    this.heard = -Infinity; // performance.now() of the last message
    this.version = -1;
    this.number = 0;
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/ws?role=${this.role}`);
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = (event) => {
      this.version = -1; // a node that was started anew counts from the beginning
      this.on.lost?.(event.reason);
      setTimeout(() => this.open(), RETRY);
    };
  }

  take(message) {
    this.heard = performance.now();
    if (message.type === "state") {
      if (message.version < this.version) return;
      this.version = message.version;
    }
    this.on[message.type]?.(message);
    // The node sends the next frames only to a page that has taken these: a busy page skips frames instead of showing old ones.
    if (message.type === "frame") this.socket.send("seen");
  }

  get connected() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  // Seconds since anything came.
  get silence() {
    return (performance.now() - this.heard) / 1000;
  }

  command(name, fields = {}) {
    if (!this.connected) {
      this.on.answer?.({ ok: false, error: "not connected to the node" });
      return;
    }
    this.socket.send(JSON.stringify({ id: ++this.number, command: name, ...fields }));
  }
}
