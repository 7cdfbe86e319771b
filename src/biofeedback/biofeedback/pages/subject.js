// The subject's screen. F makes it full-screen, M switches sound, any stop key stops; there is nothing else to operate.

import { Connection } from "./connection.js";
import { STALE } from "./screen.js";
import { hit, warning } from "./tones.js";
import { View } from "./view.js";

const STOP_KEYS = [" ", "escape"];
const alarm = document.getElementById("undelivered");
let sound = false, hits = null, leaving = false;

const view = new View(document.getElementById("view"), {
  id: "screen",
  silence: () => connection?.silence ?? Infinity,
  language: new URLSearchParams(location.search).get("language"),
});

const connection = new Connection("subject", {
  frame: (frame) => view.frame(frame),
  state(state) {
    if (sound && hits !== null && state.session.hits > hits) hit();
    hits = state.session.hits;
    view.state(state);
  },
  lost() {
    view.show();
    const [text, link] = document.getElementById("entrance").children;
    text.textContent = `⚠ ${view.texts?.enter_again ?? "Enter again."}`;
    link.textContent = view.texts?.enter ?? "/enter";
  },
  stop(what) {
    alarm.hidden = what === "confirmed";
    alarm.textContent = alarm.hidden ? "" : `⚠ ${view.texts?.undelivered ?? "STOP"}`;
    if (!alarm.hidden) warning();
  },
});
// Nothing comes: the screen itself must say so.
setInterval(() => connection.silence > STALE && view.show(), 100);

addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  if (STOP_KEYS.includes(key)) {
    event.preventDefault();
    if (!event.repeat) connection.stop();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  if (key === "m") sound = !sound;
  if (key !== "f") return;
  leaving = Boolean(document.fullscreenElement);
  if (leaving) document.exitFullscreen();
  else document.documentElement.requestFullscreen().catch(() => {});
});
// A browser keeps Esc for itself in full-screen: who leaves it that way wants to stop.
document.addEventListener("fullscreenchange", () => {
  if (!document.fullscreenElement && !leaving) connection.stop();
  leaving = false;
});
// A display that goes dark in the middle of a block interrupts the session.
const keepAwake = () => document.visibilityState === "visible" && navigator.wakeLock?.request("screen").catch(() => {});
document.addEventListener("visibilitychange", keepAwake);
keepAwake();
