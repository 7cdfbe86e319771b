// The subject's view: words above and below, the plot between them, each in a row of its own.

import { clock, Screen, shownQuality } from "./screen.js";

const LANGUAGES = ["en", "nl", "de", "fr"];
const loaded = {};

export async function texts(language) {
  const name = LANGUAGES.includes(language) ? language : "en";
  loaded[name] ??= await (await fetch(`/pages/${name}.json`)).json();
  return loaded[name];
}

const fill = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);
const put = (element, text) => element.textContent !== text && (element.textContent = text);

const ROWS = `
  <div class="v-head"><p class="v-instruction" aria-live="polite"></p><p class="v-time"></p></div>
  <div class="v-bar"><i></i></div>
  <p class="v-detail"></p>
  <p class="v-hint" aria-live="polite"></p>
  <div class="v-middle"><div class="v-side"><span class="v-up"></span><span class="v-down"></span></div>
    <canvas role="img" aria-label="Torque upwards, feedback to the right, the target and the cursor"></canvas></div>
  <div class="v-axis"><span class="v-less"></span><b class="v-name"></b><span class="v-more"></span></div>
  <p class="v-foot"></p>`;

export class View {
  // options: {id of the canvas, units: whether numbers stand at the axes, silence: seconds since anything came, language}
  constructor(container, { id, units = false, silence, language = null }) {
    container.classList.add("view");
    container.innerHTML = ROWS;
    const by = (name) => container.querySelector(`.v-${name}`);
    this.parts = Object.fromEntries(["instruction", "time", "bar", "detail", "hint", "up", "down", "less", "name", "more", "foot"].map((name) => [name, by(name)]));
    const canvas = container.querySelector("canvas");
    canvas.id = id;
    this.screen = new Screen(canvas, units);
    this.screen.silence = silence;
    this.language = language;
    this.silence = silence;
    this.texts = null;
    this.load(language ?? "en");
  }

  async load(language) {
    try {
      this.texts = await texts(language);
    } catch {
      setTimeout(() => this.load(language), 500); // the node is away
      return;
    }
    document.documentElement.lang = language;
    this.show();
  }

  frame(frame) {
    this.screen.frame = frame;
    this.show();
  }

  state(state) {
    const changed = this.screen.state?.language !== state.language;
    this.screen.state = state;
    if (changed && !this.language) this.load(state.language);
    this.show();
  }

  show() {
    this.screen.request();
    const { frame, state } = this.screen, { parts, texts: words } = this;
    if (!words) return;
    const quality = shownQuality(frame, this.silence());
    this.showHint(quality, words);
    if (!state) return;
    const { session, target } = state;
    put(parts.instruction, words.instruction[session.instruction]);
    put(parts.detail, this.detail(session, state.trials, words));
    put(parts.up, `↑ ${words.axis.up}`);
    put(parts.down, `↓ ${words.axis.down}`);
    put(parts.less, `← ${words.axis.less}`);
    put(parts.name, words.axis[target.feedback] + (this.screen.units ? `${target.feedback.length === 1 ? ` ${target.feedback}` : ""} [${target.unit.replaceAll(".", "·")}]; torque [N·m]` : ""));
    put(parts.more, `${words.axis.more} →`);
    put(parts.foot, this.success(session, state.trials, words));
    const counts = frame && (session.state === "running" || session.kind === "break");
    put(parts.time, counts && session.duration > 0 ? clock(frame.remaining) : "");
    parts.time.classList.toggle("holding", session.kind === "hold" && session.state === "running");
    const part = state.trials && session.kind === "trials" ? state.trials.done / state.trials.planned : frame && session.duration > 0 ? frame.elapsed / session.duration : 0;
    const done = counts ? Math.min(part, 1) : 0;
    parts.bar.firstChild.style.width = `${100 * done}%`;
  }

  detail(session, trials, words) {
    if (session.state !== "running") return words.detail[session.instruction] ?? "";
    if (trials) return fill(words.trial, { done: Math.min(trials.done + 1, trials.planned), planned: trials.planned });
    const block = fill(words.progress, session);
    return session.hold ? `${block} · ${fill(words.hold, session)}` : block;
  }

  // A course rewards trials, another session holds.
  success({ hits, holds_done: done }, trials, words) {
    const rate = trials ? trials.success_rate : done ? hits / done : null;
    return rate === null ? "" : fill(trials ? words.successes : words.hits, { hits, done, percent: Math.round(100 * rate) });
  }

  showHint(quality, words) {
    const { frame, state } = this.screen, { hint } = this.parts;
    const bad = quality !== "valid";
    const text = bad ? `⚠ ${words.quality[quality]}` : state?.session.state === "running" && frame?.hint ? words.hint[frame.hint] : "";
    put(hint, text);
    hint.className = `v-hint${bad ? " bad" : ["good", "success", "steady"].includes(frame?.hint) ? " good" : ""}`;
  }
}
