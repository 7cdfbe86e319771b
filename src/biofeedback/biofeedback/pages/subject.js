// The subject's screen: full-screen with F, nothing else to operate.

import { Connection } from "./connection.js";
import { Screen, STALE } from "./screen.js";

const screen = new Screen(document.getElementById("screen"));
const words = document.getElementById("words");

const connection = new Connection("subject", {
  frame: (frame) => {
    screen.frame = frame;
    screen.request();
  },
  state: (state) => {
    screen.state = state;
    if (words.textContent !== state.session.instruction) words.textContent = state.session.instruction;
    screen.request();
  },
  lost: () => screen.request(),
});
screen.silence = () => connection.silence;
// Nothing comes: the screen itself must say so.
setInterval(() => connection.silence > STALE && screen.request(), 100);

addEventListener("keydown", (event) => {
  if (event.key.toLowerCase() !== "f" || event.ctrlKey || event.metaKey) return;
  if (document.fullscreenElement) document.exitFullscreen();
  else document.documentElement.requestFullscreen().catch(() => {});
});
// A display that goes dark in the middle of a block is a broken-off session.
const keepAwake = () => document.visibilityState === "visible" && navigator.wakeLock?.request("screen").catch(() => {});
document.addEventListener("visibilitychange", keepAwake);
keepAwake();
