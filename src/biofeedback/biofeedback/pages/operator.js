// The operator's page. It keeps no state of its own: everything shown is what the node said last, so two pages always agree.

import { Connection } from "./connection.js";
import { Chords, HeldButton } from "./deliberate.js";
import { clock, STALE } from "./screen.js";
import { warning } from "./tones.js";
import { Traces } from "./traces.js";
import { View } from "./view.js";

const by = (id) => document.getElementById(id);
const put = (element, text) => element.textContent !== text && (element.textContent = text);
const SKY = "#56b4e9", ORANGE = "#e69f00", GREEN = "#00b384", YELLOW = "#f0e442", PINK = "#d98cb8", VERMILLION = "#ff7a33";
const FEW_MEGABYTES = 2000; // about two hours of the laboratory's topics; below, the disk is shown as a warning

const view = new View(by("preview"), { id: "screen", units: true, silence: () => connection?.silence ?? Infinity, language: "en" });
const traces = new Traces(by("traces"), [
  { title: "Torque", unit: "N·m, measured", group: "ankle", names: ["torque"], colours: [SKY], least: 2 },
  { title: "Angle", unit: "degrees", group: "ankle", names: ["angle"], colours: [YELLOW], least: 1 },
  { title: "K", unit: "N·m/rad", group: "estimate", names: ["K"], colours: [ORANGE], zero: true, value: true, marks: marks("K"), absent: "no valid estimate", needed: withEstimates },
  { title: "G", unit: "N·m·s/rad", group: "estimate", names: ["G"], colours: [GREEN], zero: true, value: true, marks: marks("G"), absent: "no valid estimate", needed: withEstimates },
  ...[["SOL", SKY], ["TA", PINK], ["GL", ORANGE], ["GM", GREEN]].map(([name, colour]) => (
    { title: name, unit: "EMG, µV", group: "emg", names: [name], colours: [colour], least: 10, absent: "no /emg/samples in this graph", needed: (state) => !ofRig(state) })),
]);

// A course of the EMG reflex needs no estimator: then nothing is said of estimates.
function ofReflex({ target }) {
  return target.feedback === "reflex";
}

// A calibration of the rig has neither subject nor estimator.
const ofRig = ({ session }) => session.kind === "rig_calibration";

function withEstimates(state) {
  return !ofReflex(state) && !ofRig(state);
}

function marks(symbol) {
  return ({ target }) => (target.feedback === symbol && target.lower !== null ? [target.lower, target.upper] : []);
}

let alarmUntil = 0;
let last = null;
let inCommand = false, wantsCommand = false;

const connection = new Connection("operator", {
  frame(frame) {
    view.frame(frame);
    traces.now = frame.now;
    showFrame(frame);
  },
  state: showState,
  traces: (message) => traces.take(message),
  answer(answer) {
    if (!answer.ok) alarm(answer.error, 6000);
  },
  command(message) {
    inCommand = message.yours;
    if (last) {
      showButtons(last);
      showChecks(last.checks);
    }
  },
  // A page that was in command takes it again after a lost connection, unless another one has it now.
  opened: () => wantsCommand && !last?.pages.in_command && connection.command("claim"),
  stop(what) {
    by("undelivered").hidden = what === "confirmed";
    put(by("undelivered"), what === "confirmed" ? "" : "STOP COULD NOT BE DELIVERED YET. Use the emergency stop. It is sent as soon as the connection is back.");
    if (what !== "confirmed") warning();
  },
  lost() {
    traces.forget();
    view.show();
    showLink();
  },
});

setInterval(() => {
  showLink();
  if (connection.silence > STALE) view.show();
  traces.request(); // also when nothing comes: the gap grows
  if (alarmUntil && performance.now() > alarmUntil) {
    alarmUntil = 0;
    by("alarm").hidden = true;
  }
}, 200);

function alarm(text, milliseconds) {
  put(by("alarm"), text);
  by("alarm").hidden = false;
  alarmUntil = performance.now() + milliseconds;
}

function pill(element, text, kind) {
  put(element, text);
  element.className = `pill ${kind}`;
}

function showLink() {
  const silent = connection.silence > STALE;
  pill(by("link"), silent ? "✕ no connection to the node" : "● connected", silent ? "bad" : "good");
}

function showFrame(frame) {
  put(by("clock"), `${Math.floor(frame.clock / 60)}:${String(Math.floor(frame.clock % 60)).padStart(2, "0")}`);
  if (!last) return;
  const { session } = last;
  const counting = session.state === "running" || session.kind === "break";
  put(by("remaining"), counting && session.duration > 0 ? clock(frame.remaining) : "");
  const { trials } = last;
  const part = trials && session.kind === "trials" ? trials.done / trials.planned : session.duration > 0 && counting ? frame.elapsed / session.duration : 0;
  by("bar").style.width = `${Math.min(100 * part, 100)}%`;
  const quality = ofReflex(last)
    ? { valid: "", invalid: "EMG is not usable", stale: "EMG is stale", waiting: "no EMG yet: do the amplifier and the node emg_processor run?" }
    : { valid: last.doubt ? `estimates are doubtful: ${last.doubt}` : "", invalid: `estimates not valid${last.reason ? `: ${last.reason}` : ""}`, stale: "estimates are stale", waiting: "no estimates yet: does the node impedance_estimator run?" };
  const torque = { valid: "", stale: "no samples", waiting: "no samples yet" }[frame.torque_quality];
  const said = [ofRig(last) ? "" : quality[frame.quality], torque].filter(Boolean).join("; ");
  by("share").className = said ? "warn" : "";
  showRelative(frame, last);
  put(by("share"), said ? `⚠ ${said}` : last.trials ? progress(last) : share(session));
}

// K and G now against the largest torque of the check list and the body mass, at the torque that they belong to.
function showRelative({ K, G, torque }, { checks, body_mass: mass }) {
  const largest = largestTorque(checks);
  by("relative").hidden = !(largest > 0 || mass > 0);
  if (by("relative").hidden) return;
  const relative = (value, perTorque, perMass) => {
    if (value === null) return "–";
    const parts = [];
    if (largest > 0) parts.push(`${three((100 * value) / largest)} ${perTorque}`);
    if (mass > 0) parts.push(`${three(value / mass)} ${perMass}`);
    return parts.join(", ");
  };
  const estimates = ofReflex(last) && K === null ? "torque" : `K ${relative(K, "%MVC/rad", "N·m/rad/kg")}; G ${relative(G, "%MVC·s/rad", "N·m·s/rad/kg")}; at`;
  put(by("relative"), `${estimates} ${
    torque === null ? "–" : torque.toFixed(1)} N·m${largest > 0 && torque !== null ? ` (${Math.round(Math.abs(100 * torque) / largest)} %MVC)` : ""}`);
}

const three = (value) => Number(value.toPrecision(3));
const largestTorque = (checks) => Math.abs(checks.find(({ name }) => name === "mvc_plantarflexion")?.result["torque[N.m]"] ?? NaN);

const percent = (part) => `${Math.round(100 * part)} %`;

// A conditioning course: the background that a trial waits for, and how the trials go.
function progress({ session, trials, checks }) {
  if (session.state === "finished") return "All trials of this session are done and kept. The next session of the course follows in the next visit.";
  const { activity, activity_window: [lower, upper], held, waiting, success_rate: rate } = trials;
  const contracted = checks.every(({ name, state }) => name !== "mvc_plantarflexion" || state === "done");
  const emg = activity === null ? (contracted ? "no EMG" : "EMG counts from the maximal push of the check list") : `EMG ${percent(activity)} of MVC (wanted ${percent(lower)} to ${percent(upper)})`;
  const now = waiting ? "perturbation asked for" : held ? "background held" : "waiting for the background";
  return `${now}; ${emg}${rate === null ? "" : `; ${percent(rate)} successes`}`;
}

function share({ kind, hold_share: [valid, inside] }) {
  if (kind !== "hold" || valid === null) return "";
  return `this hold: ${Math.round(100 * valid)} % valid, ${Math.round(100 * inside)} % in the target`;
}

function showState(state) {
  last = traces.state = state;
  view.state(state);
  const { session, target, recording } = state;
  put(by("title"), state.visit ? `${state.visit}: ${session.title}` : session.title);
  const kinds = { running: "good", armed: "warn", paused: "warn", idle: "", finished: "" };
  pill(by("state"), session.state, kinds[session.state]);
  const { trials } = state;
  document.body.classList.toggle("of-rig", ofRig(state));
  put(by("where"), ofRig(state) ? "no subject" : session.block ? `block ${session.block} of ${session.blocks}` : "control trials");
  put(by("where-what"), ofRig(state) ? "" : trials ? `trial ${trials.done} of ${trials.planned}` : session.hold ? `hold ${session.hold} of ${session.holds}` : session.kind);
  const steps = { calibration: "Calibration, relaxed", rig_calibration: "The plate moves by itself", trials: `Trials, ${trials?.kind}`, baseline: "Baseline, relaxed", reach: `On the way to hold ${session.hold}`, hold: `Hold ${session.hold}`, break: "Break" };
  const before = ofRig(state) && session.state !== "running" ? "Calibration of the rig" : steps[session.kind];
  put(by("step"), session.state === "finished" ? "Finished" : before);
  pill(by("recording"), recording.on ? `● recording${recording.missing ? `, ${recording.missing} SAMPLES MISSING` : ""}` : "✕ NOT RECORDING",
    recording.on && !recording.missing ? "good" : "bad");
  by("recording").title = recording.on ? `${recording.messages} messages so far` : "start a recorder: ankle record NAME";
  const low = recording.free !== null && recording.free < FEW_MEGABYTES;
  pill(by("disk"), recording.free === null ? "disk: no recorder" : `${low ? "⚠ " : ""}${(recording.free / 1000).toFixed(1)} GB free`, low ? "bad" : "");
  const rigState = (state.rig.state || state.rig.name || "").slice(0, 40);
  pill(by("rig"), state.rig.name ? `rig: ${rigState}` : "✕ no rig driver", !state.rig.name ? "warn" : rigState.startsWith("fault") ? "bad" : "good");
  by("rig").title = state.rig.problem;
  put(by("version"), `state ${state.version}; open pages: ${state.pages.operator} operator, ${state.pages.subject} subject`);
  showButtons(state);
  showUnconfirmed(state.rig);
  showForms(state, target);
  showSubject(state.subject);
  showChecks(state.checks);
  showNodes(state);
  showLog(state.log);
}

// A stop that a driver has not confirmed is louder than anything else on the page.
function showUnconfirmed(rig) {
  if (!rig.stop_unconfirmed.length) return;
  alarm(`STOP NOT CONFIRMED by ${rig.stop_unconfirmed.join(", ")}. Use the emergency stop.`, 3000);
  warning();
}

// STOP is never disabled.
function showButtons({ session, rig, pages }) {
  const running = session.state === "running", holding = running && session.kind === "hold";
  const able = {
    arm: ["idle", "paused"].includes(session.state), start: session.state === "armed", pause: running,
    start_hold: running && session.kind === "reach", end_hold: holding, next: running && session.kind !== "trials", reset_fault: rig.name !== null,
    restart: ["idle", "paused", "finished"].includes(session.state),
  };
  for (const button of document.querySelectorAll("button[data-command]")) {
    const name = button.dataset.command;
    if (name !== "stop") button.disabled = !inCommand || !able[name];
  }
  by("claim").hidden = inCommand;
  put(by("claim"), pages.in_command ? "Take over command" : "Take command");
}

const fine = (value) => (value === null || value === undefined ? "" : String(three(value)));

// A field that somebody is typing into is left alone.
function fill(form, values) {
  for (const [name, value] of Object.entries(values)) {
    const field = form.elements[name];
    if (document.activeElement !== field && !field.dataset.touched) field.value = typeof value === "number" || value === null ? fine(value) : value;
  }
}

function showForms(state, target) {
  const unit = target.unit.replaceAll(".", "·");
  document.querySelectorAll(".unit").forEach((element) => put(element, unit));
  const region = target.lower === null ? "no region" : `${fine(target.lower)}–${fine(target.upper)} ${unit}`;
  put(by("target-now"), `${fine(target.torque)} ± ${fine(target.torque_half_width)} N·m; ${target.feedback}: ${region}`);
  put(by("axis-now"), ofReflex(state) ? "from the subject's own reflexes" : state.baseline ? `baseline K ${fine(state.baseline.K)}, G ${fine(state.baseline.G)}${ofMvc(state)}` : "no baseline yet");
  for (const part of by("target").querySelectorAll("label, button")) part.hidden = Boolean(state.trials);
  by("target-of-course").hidden = !state.trials;
  fill(by("target"), { "torque[N.m]": target.torque, "torque_half_width[N.m]": target.torque_half_width, feedback: target.feedback, lower: target.lower, upper: target.upper });
  fill(by("axis"), { x_upper: state.axes.x[1], "y_lower[N.m]": state.axes.y[0], "y_upper[N.m]": state.axes.y[1] });
}

// K and G of the baseline against the largest plantarflexion torque of the check list.
function ofMvc({ baseline, checks }) {
  const largest = largestTorque(checks);
  if (!(largest > 0)) return "";
  const part = (value) => three((100 * value) / largest);
  return ` = ${part(baseline.K)} %MVC/rad, ${part(baseline.G)} %MVC·s/rad`;
}

function showSubject(subject) {
  by("simulated-subject").hidden = !subject;
  if (!subject) return;
  for (const input of by("simulated-subject").querySelectorAll("input")) {
    const held = (document.activeElement === input && input.dataset.dragged) || (wanted && input.name in wanted);
    if (!held) input.value = subject[input.name];
    put(input.nextElementSibling, input.name === "push" ? `${subject.push.toFixed(1)} N·m` : subject[input.name].toFixed(2));
  }
}

function replaceList(list, items) {
  list.replaceChildren(...items.map(([text, kind, head]) => {
    const item = document.createElement("li");
    item.className = kind;
    const name = document.createElement("b");
    name.textContent = head;
    item.append(name, ` ${text}`);
    return item;
  }));
}

// Units of a recording that nobody reads numbers in, with the factor to those of a screen.
const SHOWN_UNITS = { V: [1e6, "µV"], "V.s": [1e6, "µV·s"], rad: [180 / Math.PI, "degrees"] };

// A key with its unit, as "torque[N.m]", and its value in words.
function quantity(key, value) {
  const [, name, unit] = key.match(/^([^[]*)(?:\[(.*)\])?$/);
  const [factor, shown] = SHOWN_UNITS[unit] ?? [1, unit?.replaceAll(".", "·")];
  const said = unit && typeof value === "number" ? rounded(factor * value) : value;
  return `${name.replaceAll("_", " ")} ${said}${shown && shown !== "1" ? ` ${shown}` : ""}`;
}

// Three digits that count, and none behind the third place after the point.
const rounded = (value) => (Math.abs(value) < 1 ? Number(value.toFixed(3)) : three(value));

const CHECK_SIGNS = { open: "○", running: "…", done: "✓", failed: "✕", skipped: "–" };

// The visit's check list, hidden once it is complete, but for the result of a rig's calibration: each entry with what to do, its result, and its buttons; a required one cannot be skipped.
function showChecks(checks) {
  const missing = checks.filter(({ state }) => state !== "done" && state !== "skipped");
  by("check-list").hidden = !missing.length && !ofRig(last);
  const shown = JSON.stringify([checks, inCommand]);
  if (by("checks").dataset.shown === shown) return;
  by("checks").dataset.shown = shown;
  by("checks").replaceChildren(...checks.map(({ name, title, instruction, measured, required, from_file: fromFile, in_motion: inMotion, state, result }) => {
    const item = document.createElement("li"), text = document.createElement("p");
    item.className = { done: "ok", skipped: "ok", failed: "error", running: "warning" }[state] ?? "";
    const head = document.createElement("b");
    head.textContent = `${CHECK_SIGNS[state]} ${title}`;
    const lines = name === "calibrate_rig" && state === "done"; // a result of many values, in words
    const say = ([key, value]) => (["problem", "progress"].includes(key) ? value : lines ? `\n${key}: ${value}` : quantity(key, value));
    const figures = Object.entries(result).map(say).join(lines ? "" : ", ");
    text.append(head, ` ${figures || (state === "open" || state === "running" ? instruction : state)}`);
    item.append(text);
    if (state !== "done" && state !== "skipped") {
      const begin = inMotion ? (state === "failed" ? "Calibrate again" : "Calibrate") : fromFile ? "Read again" : !measured ? "Confirm" : state === "failed" ? "Again" : "Measure";
      for (const [act, word] of required ? [["begin", begin]] : [["begin", begin], ["skip", "Skip"]]) {
        const button = document.createElement("button");
        button.className = "slim";
        button.textContent = word;
        button.disabled = !inCommand || (state === "running" && !(inMotion && act === "skip"));
        button.addEventListener("click", () => connection.command("check", { check: name, act }));
        item.append(button);
      }
    }
    return item;
  }));
}

const SIGNS = { ok: "✓", warning: "⚠", error: "✕", silent: "✕", stale: "✕" };

function showNodes(state) {
  const items = state.nodes.map((node) => [node.message, node.level, `${SIGNS[node.level]} ${node.name}`]);
  if (state.rig.problem) items.unshift([state.rig.problem, "warning", "⚠ rig"]);
  if (!state.nodes.length) items.push(["no node has said anything yet", "warning", "⚠"]);
  replaceList(by("nodes"), items);
}

function showLog(log) {
  replaceList(by("log"), log.slice().reverse().map(({ t, event, details }) => {
    const more = Object.entries(details).map(([key, value]) => quantity(key, value)).join(", ");
    return [`${event}${more ? `: ${more}` : ""}`, event === "fault" ? "error" : "", new Date(1000 * t).toTimeString().slice(0, 8)];
  }));
}

// What moves the foot or ends a hold has to be held; the other buttons act at once.
const HELD = { a: "arm", s: "start", p: "pause", n: "next", e: "end_hold", r: "reset_fault", new: "restart" };
const tooShort = () => alarm("keep the button pressed for a second", 2500);
const chords = {};
for (const [key, name] of Object.entries(HELD)) {
  chords[key] = new HeldButton(document.querySelector(`button[data-command="${name}"]`), () => connection.command(name), tooShort);
}
new Chords(chords);
document.querySelector('button[data-command="start_hold"]').addEventListener("click", () => connection.command("start_hold"));
// Stops when the pointer goes down, not when it comes up.
document.querySelector('button[data-command="stop"]').addEventListener("pointerdown", () => connection.stop());
by("claim").addEventListener("click", () => {
  wantsCommand = true;
  connection.command("claim");
});

function showView(simple) {
  document.body.classList.toggle("simple", simple);
  by("simple").setAttribute("aria-pressed", String(simple));
  put(by("simple"), simple ? "Expert view" : "Simple view");
  traces.fit();
}
by("simple").addEventListener("click", () => {
  const simple = !document.body.classList.contains("simple");
  localStorage.setItem("view", simple ? "simple" : "expert");
  showView(simple);
});
showView(localStorage.getItem("view") === "simple");

for (const form of [by("target"), by("axis")]) {
  form.addEventListener("input", (event) => (event.target.dataset.touched = "1"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const fields = {};
    for (const field of form.querySelectorAll("[data-touched]")) {
      if (field.value === "" && !["lower", "upper"].includes(field.name)) continue;
      fields[field.name] = field.tagName === "SELECT" ? field.value : field.value === "" ? null : Number(field.value);
      delete field.dataset.touched;
    }
    if (Object.keys(fields).length) connection.command(form.id === "target" ? "set_target" : "set_axis", fields);
    document.activeElement?.blur();
  });
}
by("axis-baseline").addEventListener("click", () => connection.command("set_axis", { x_upper: null, "y_lower[N.m]": null, "y_upper[N.m]": null }));

by("note").addEventListener("submit", (event) => {
  event.preventDefault();
  const field = event.target.elements.text;
  if (field.value.trim()) connection.command("note", { text: field.value.trim() });
  field.value = "";
  field.blur();
});

let wanted = null; // what sliders say and was not sent yet: a state that comes in between must not take its place
by("simulated-subject").addEventListener("input", ({ target }) => {
  target.dataset.dragged = "1";
  // Ten a second while a slider is dragged, the last position always.
  if (!wanted) {
    wanted = {};
    setTimeout(() => {
      connection.command("subject", wanted);
      wanted = null;
    }, 100);
  }
  wanted[target.name] = Number(target.value);
});
by("simulated-subject").addEventListener("change", ({ target }) => delete target.dataset.dragged);

// Single keys move nothing and end nothing, except that two of them stop.
addEventListener("keydown", (event) => {
  const key = event.key.toLowerCase();
  const typing = ["INPUT", "SELECT", "TEXTAREA"].includes(document.activeElement?.tagName) && document.activeElement.type !== "range";
  if (key === "escape" || (key === " " && !typing)) {
    event.preventDefault(); // Space must not press the button that was clicked last as well
    if (!event.repeat) connection.stop();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || typing) return;
  if (key === "h") by("start-hold").disabled || connection.command("start_hold");
  else if (key === "o") window.open("/", "subject");
  else if (key === "t") by("target").elements["torque[N.m]"].select();
  else if (key !== "enter") return;
  event.preventDefault();
});
