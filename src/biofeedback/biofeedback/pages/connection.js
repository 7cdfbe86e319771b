// The WebSocket of a page: the newest frame and state, commands and their answers, and connecting again after a loss.
//
// A stop goes two ways: through the WebSocket, and where that does not confirm it in time through a request of its own.
// One that cannot be delivered is kept, sent first of all when the connection is back, and reported until then.

import { typed } from "./strict.js";

const RETRY = 300; // ms; a node that restarts is back within seconds
const CONFIRM = 250; // ms in which a stop is confirmed; a loaded node answers within 100

export class Connection {
  // on: {frame, state, traces, answer, command, lost, stop}, each a function of the message; stop of "confirmed" or "undelivered".
  constructor(role, on) {
    this.role = role;
    this.on = on;
    this.heard = -Infinity; // performance.now() of the last message
    this.version = -1;
    this.number = 0;
    this.stopping = null; // number of the stop that is not confirmed yet
    this.open();
  }

  open() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/ws?role=${this.role}`);
    this.socket.onopen = () => {
      document.getElementById("entrance").hidden = true;
      if (this.stopping !== null) this.sendStop();
      this.on.opened?.();
    };
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = (event) => {
      this.version = -1; // a node that was started anew counts from the beginning
      this.on.lost?.(event.reason);
      this.askForEntrance();
      setTimeout(() => this.open(), RETRY);
    };
  }

  // A node that was started anew does not know this browser any more: it is there, and refuses the page. The page then
  // says so, with the link to enter again, and stays, because a stop may still have to be shown.
  async askForEntrance() {
    try {
      const answer = await fetch(`/entrance?role=${this.role}`, { signal: AbortSignal.timeout(2000) });
      document.getElementById("entrance").hidden = answer.status !== 401;
    } catch {
      // The node is away.
    }
  }

  take(message) {
    this.heard = performance.now();
    // The node sends the next frames only to a page that has taken these: a busy page skips frames instead of showing old ones.
    if (message.type === "frame") this.socket.send("seen");
    if (message.type === "state") {
      if (message.version < this.version) return;
      this.version = message.version;
    }
    if (message.type === "answer" && message.id === this.stopping) return this.confirmed();
    this.on[message.type]?.(typed(message));
  }

  get connected() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  // Seconds since anything came.
  get silence() {
    return (performance.now() - this.heard) / 1000;
  }

  command(name, fields = {}) {
    if (name === "stop") return this.stop();
    if (!this.connected) {
      this.on.answer?.({ ok: false, error: "not connected to the node" });
      return;
    }
    this.socket.send(JSON.stringify({ id: ++this.number, command: name, ...fields }));
  }

  stop() {
    this.stopping = ++this.number;
    this.sendStop();
    const number = this.stopping;
    if (!this.connected) this.on.stop?.("undelivered");
    setTimeout(() => this.stopping === number && this.insist(), CONFIRM);
  }

  sendStop() {
    if (this.connected) this.socket.send(JSON.stringify({ id: this.stopping, command: "stop" }));
  }

  // The other way, until one of the two has worked.
  async insist() {
    const number = this.stopping;
    if (number === null) return;
    this.on.stop?.("undelivered");
    try {
      const answer = await fetch("/stop", { method: "POST", signal: AbortSignal.timeout(1000) });
      if (answer.ok && this.stopping === number) return this.confirmed();
    } catch {
      // No connection this way either.
    }
    setTimeout(() => this.stopping === number && this.insist(), CONFIRM);
  }

  confirmed() {
    this.stopping = null;
    this.on.stop?.("confirmed");
  }
}
