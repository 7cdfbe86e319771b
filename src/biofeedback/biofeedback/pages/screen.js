// The 2-D screen: torque upwards, feedback to the right, band, region and cursor.
//
// Sizes are parts of the height: letters of 5 % are 17 mm high on a 24 inch screen, read without effort from two metres.
// Colours are Okabe and Ito's; whatever a colour says is also said by a shape or a word.

const BACKGROUND = "#10151c", GRID = "#2b3542", TEXT = "#f2f5f8", DIM = "#9aa7b5";
const SKY = "#56b4e9", GREEN = "#00b384", YELLOW = "#f0e442", ORANGE = "#e69f00", VERMILLION = "#ff7a33", GREY = "#a8b0b8";
const NAMES = { K: "Stiffness", G: "Reflex" };
export const STALE = 0.5; // s without a frame after which this page itself says that nothing comes

const SAYINGS = {
  waiting: ["WAITING FOR A MEASUREMENT", "nothing has come yet"],
  invalid: ["NO VALID MEASUREMENT", "keep going, it will come back"],
  stale: ["NO SIGNAL", "the cursor stands still because nothing comes"],
  lost: ["NO CONNECTION", "the screen will go on by itself"],
};

// How the frame must be shown: its own quality, unless nothing has come for too long.
export function shownQuality(frame, silence) {
  if (silence > STALE) return "lost";
  if (!frame) return "waiting";
  if (frame.quality === "stale" || frame.torque_quality === "stale") return "stale";
  if (frame.quality === "waiting" || frame.torque_quality === "waiting") return "waiting";
  return frame.quality;
}

// Draws everything. Returns {quality, x, y}: the cursor's place in pixels.
export function drawScreen(context, width, height, frame, state, silence) {
  context.fillStyle = BACKGROUND;
  context.fillRect(0, 0, width, height);
  const quality = shownQuality(frame, silence);
  if (!state) {
    banner(context, { left: 0, top: 0, width, height }, height, quality, 0, true);
    return { quality, x: NaN, y: NaN };
  }
  const plot = { left: 0.15 * height, top: 0.2 * height, width: width - 0.21 * height, height: 0.63 * height };
  const to = scale(plot, state.axes);
  const running = state.session.state === "running" && state.session.kind !== "break";
  drawGrid(context, plot, height, to, state);
  const inside = running && quality === "valid" && frame.in_target && state.session.kind !== "baseline";
  drawTargets(context, plot, height, to, state.target, running, inside);
  drawHead(context, width, height, frame, state);
  const place = running || quality !== "valid" ? drawCursor(context, plot, height, to, frame, quality, inside) : { x: NaN, y: NaN };
  // Where the cursor is not, so that both are seen.
  const upper = !(place.y < plot.top + plot.height / 2);
  if (quality !== "valid") banner(context, plot, height, quality, quality === "lost" ? silence : frame?.age ?? 0, upper);
  else if (!running) rest(context, plot, height, state.session);
  return { quality, ...place };
}

function scale(plot, axes) {
  const [x0, x1] = axes.x, [y0, y1] = axes.y;
  return {
    x: (value) => plot.left + (plot.width * (value - x0)) / (x1 - x0),
    y: (value) => plot.top + plot.height * (1 - (value - y0) / (y1 - y0)),
  };
}

function font(context, size, weight = 600) {
  context.font = `${weight} ${Math.round(size)}px "Inter", "Segoe UI", "DejaVu Sans", system-ui, sans-serif`;
}

function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((s) => s >= rough);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high + 1e-9; k++) found.push(k * step);
  return found;
}

function label(value) {
  return String(Number(value.toPrecision(3))).replace("-", "−");
}

function drawGrid(context, plot, height, to, state) {
  const bottom = plot.top + plot.height, right = plot.left + plot.width;
  context.lineWidth = Math.max(1, 0.002 * height);
  context.strokeStyle = GRID;
  context.fillStyle = DIM;
  font(context, 0.034 * height, 500);
  context.textBaseline = "top";
  context.textAlign = "center";
  for (const value of ticks(...state.axes.x, 6)) {
    line(context, to.x(value), plot.top, to.x(value), bottom);
    context.fillText(label(value), to.x(value), bottom + 0.014 * height);
  }
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const value of ticks(...state.axes.y, 6)) {
    line(context, plot.left, to.y(value), right, to.y(value));
    context.fillText(label(value), plot.left - 0.014 * height, to.y(value));
  }
  context.strokeStyle = DIM;
  context.strokeRect(plot.left, plot.top, plot.width, plot.height);
  context.fillStyle = TEXT;
  font(context, 0.046 * height);
  context.textAlign = "center";
  context.textBaseline = "bottom";
  const unit = state.target.unit.replaceAll(".", "·");
  context.fillText(`${NAMES[state.target.feedback]} ${state.target.feedback} [${unit}]`, plot.left + plot.width / 2, height - 0.018 * height);
  context.save();
  context.translate(0.05 * height, plot.top + plot.height / 2);
  context.rotate(-Math.PI / 2);
  context.textBaseline = "middle";
  context.fillText("Torque [N·m]", 0, 0);
  context.restore();
  if (state.baseline) {
    const x = to.x(state.baseline[state.target.feedback]), size = 0.018 * height;
    context.fillStyle = TEXT;
    polygon(context, [[x, bottom - size], [x - size, bottom + 0.2 * size], [x + size, bottom + 0.2 * size]]);
    context.fill();
    font(context, 0.028 * height, 500);
    context.textAlign = "center";
    context.fillStyle = DIM;
    context.fillText("at rest", x, bottom - 1.2 * size);
  }
}

function drawTargets(context, plot, height, to, target, running, inside) {
  const strong = running ? 1 : 0.45;
  const top = to.y(target.torque + target.torque_half_width), bottom = to.y(target.torque - target.torque_half_width);
  context.save();
  context.beginPath();
  context.rect(plot.left, plot.top, plot.width, plot.height);
  context.clip();
  context.globalAlpha = 0.2 * strong;
  context.fillStyle = SKY;
  context.fillRect(plot.left, top, plot.width, bottom - top);
  context.globalAlpha = strong;
  context.strokeStyle = SKY;
  context.lineWidth = 0.006 * height;
  line(context, plot.left, top, plot.left + plot.width, top);
  line(context, plot.left, bottom, plot.left + plot.width, bottom);
  if (target.lower !== null) {
    const left = to.x(target.lower), right = to.x(target.upper);
    context.globalAlpha = 0.16 * strong;
    context.fillStyle = GREEN;
    context.fillRect(left, plot.top, right - left, plot.height);
    context.globalAlpha = strong;
    context.strokeStyle = GREEN;
    context.setLineDash([0.022 * height, 0.014 * height]);
    line(context, left, plot.top, left, plot.top + plot.height);
    line(context, right, plot.top, right, plot.top + plot.height);
    context.setLineDash([]);
    goal(context, left, top, right, bottom, height, inside, strong);
  }
  context.restore();
}

// Where band and region cross: a filled field with corner brackets, a full frame once the cursor is in it.
function goal(context, left, top, right, bottom, height, inside, strong) {
  context.globalAlpha = (inside ? 0.34 : 0.16) * strong;
  context.fillStyle = YELLOW;
  context.fillRect(left, top, right - left, bottom - top);
  context.globalAlpha = strong;
  context.strokeStyle = YELLOW;
  context.lineWidth = 0.01 * height;
  context.lineJoin = "miter";
  if (inside) {
    context.strokeRect(left, top, right - left, bottom - top);
    return;
  }
  const dx = Math.min(0.05 * height, (right - left) / 3), dy = Math.min(0.05 * height, (bottom - top) / 3);
  for (const [x, y, sx, sy] of [[left, top, 1, 1], [right, top, -1, 1], [left, bottom, 1, -1], [right, bottom, -1, -1]]) {
    context.beginPath();
    context.moveTo(x + sx * dx, y);
    context.lineTo(x, y);
    context.lineTo(x, y + sy * dy);
    context.stroke();
  }
}

function drawHead(context, width, height, frame, state) {
  const { session } = state, left = 0.05 * height, right = width - 0.06 * height;
  context.textBaseline = "middle";
  context.textAlign = "left";
  context.fillStyle = TEXT;
  font(context, 0.068 * height, 700);
  context.fillText(session.instruction, left, 0.068 * height);
  if (session.state === "running") {
    const target = session.kind === "baseline" ? "no target yet" : `target ${label(state.target.torque)} N·m`;
    font(context, 0.036 * height, 500);
    context.fillStyle = DIM;
    const hold = session.hold ? `, hold ${session.hold} of ${session.holds}` : "";
    context.fillText(`Block ${session.block} of ${session.blocks}${hold}, ${target}`, left, 0.128 * height);
  }
  const counts = session.state === "running" || session.kind === "break";
  if (!frame || !counts) return;
  context.textAlign = "right";
  font(context, 0.085 * height, 700);
  context.fillStyle = session.kind === "hold" ? YELLOW : TEXT;
  context.fillText(clock(frame.remaining), right, 0.07 * height);
  const done = session.duration > 0 ? Math.min(frame.elapsed / session.duration, 1) : 1;
  const bar = { x: left, y: 0.164 * height, width: right - left, height: 0.016 * height };
  context.fillStyle = GRID;
  context.fillRect(bar.x, bar.y, bar.width, bar.height);
  context.fillStyle = session.kind === "hold" ? YELLOW : DIM;
  context.fillRect(bar.x, bar.y, bar.width * done, bar.height);
}

export function clock(seconds) {
  const whole = Math.ceil(seconds);
  return whole < 100 ? `${whole} s` : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function drawCursor(context, plot, height, to, frame, quality, inside) {
  if (!frame) return { x: NaN, y: NaN };
  const radius = 0.034 * height;
  const known = { x: frame.x !== null, y: frame.y !== null };
  const wanted = { x: known.x ? to.x(frame.x) : plot.left + plot.width / 2, y: known.y ? to.y(frame.y) : plot.top + plot.height / 2 };
  const x = Math.min(Math.max(wanted.x, plot.left + radius), plot.left + plot.width - radius);
  const y = Math.min(Math.max(wanted.y, plot.top + radius), plot.top + plot.height - radius);
  context.globalAlpha = 1;
  if (quality === "valid") {
    solidCursor(context, x, y, radius, height, inside);
    const beyond = [wanted.x - x, wanted.y - y];
    if (Math.hypot(...beyond) > radius) arrow(context, x, y, radius, Math.atan2(beyond[1], beyond[0]));
  } else {
    if (frame.torque_quality === "valid") torqueLine(context, plot, height, y);
    hollowCursor(context, x, y, 1.15 * radius, height);
  }
  return { x, y };
}

function solidCursor(context, x, y, radius, height, inside) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = inside ? GREEN : ORANGE;
  context.fill();
  context.lineWidth = 0.007 * height;
  context.strokeStyle = "#ffffff";
  context.stroke();
  if (!inside) return;
  context.lineWidth = 0.011 * height;
  context.lineCap = "round";
  context.beginPath();
  context.moveTo(x - 0.45 * radius, y + 0.02 * radius);
  context.lineTo(x - 0.1 * radius, y + 0.4 * radius);
  context.lineTo(x + 0.5 * radius, y - 0.38 * radius);
  context.stroke();
  context.lineCap = "butt";
}

function arrow(context, x, y, radius, angle) {
  context.save();
  context.translate(x, y);
  context.rotate(angle);
  context.fillStyle = BACKGROUND;
  polygon(context, [[0.7 * radius, 0], [-0.4 * radius, -0.6 * radius], [-0.4 * radius, 0.6 * radius]]);
  context.fill();
  context.restore();
}

function hollowCursor(context, x, y, radius, height) {
  context.save();
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.save();
  context.clip();
  context.strokeStyle = GREY;
  context.lineWidth = 0.0035 * height;
  for (let offset = -2 * radius; offset < 2 * radius; offset += 0.014 * height) {
    line(context, x + offset - radius, y + radius, x + offset + radius, y - radius);
  }
  context.restore();
  context.setLineDash([0.018 * height, 0.012 * height]);
  context.lineWidth = 0.008 * height;
  context.strokeStyle = GREY;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
  context.restore();
}

function torqueLine(context, plot, height, y) {
  context.save();
  context.setLineDash([0.03 * height, 0.02 * height]);
  context.lineWidth = 0.004 * height;
  context.strokeStyle = GREY;
  line(context, plot.left, y, plot.left + plot.width, y);
  context.restore();
}

function banner(context, plot, height, quality, age, upper) {
  const [head, more] = SAYINGS[quality];
  const old = Number.isFinite(age) && age > STALE ? ` FOR ${age < 100 ? age.toFixed(1) : Math.round(age)} s` : "";
  const middle = plot.top + (upper ? 0.17 : 0.83) * plot.height;
  box(context, plot, height, middle, head + (quality === "stale" || quality === "lost" ? old : ""), more, VERMILLION, true);
}

function rest(context, plot, height, session) {
  const more = { idle: "the session has not started", armed: "it begins in a moment", finished: "the session is over" }[session.state];
  box(context, plot, height, plot.top + 0.42 * plot.height, session.instruction.toUpperCase(), more ?? "you may relax", SKY, false);
}

function box(context, plot, height, middle, head, more, colour, warning) {
  const size = 0.058 * height;
  font(context, size, 700);
  const words = warning ? `⚠ ${head}` : head;
  const width = Math.min(Math.max(context.measureText(words).width + 2.2 * size, 0.6 * height), 0.98 * plot.width);
  const tall = 2.9 * size, left = plot.left + (plot.width - width) / 2;
  context.fillStyle = "rgba(8, 11, 15, 0.9)";
  context.strokeStyle = colour;
  context.lineWidth = 0.007 * height;
  context.beginPath();
  context.roundRect(left, middle - tall / 2, width, tall, 0.25 * size);
  context.fill();
  context.stroke();
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = TEXT;
  context.fillText(words, plot.left + plot.width / 2, middle - 0.45 * size, width - size);
  font(context, 0.6 * size, 500);
  context.fillStyle = DIM;
  context.fillText(more, plot.left + plot.width / 2, middle + 0.72 * size, width - size);
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

function polygon(context, points) {
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.closePath();
}

// Keeps a canvas as sharp as the display, draws into it once for each frame that came, and ages what is shown when none comes.
export class Screen {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.frame = null;
    this.state = null;
    this.drawn = 0;
    this.requested = false;
    new ResizeObserver(() => this.fit()).observe(canvas);
    this.fit();
  }

  fit() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.request();
  }

  request() {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.requested = false;
    const silence = this.silence ? this.silence() : 0;
    const { canvas } = this;
    if (!canvas.width || !canvas.height) return;
    const { quality, x, y } = drawScreen(this.context, canvas.width, canvas.height, this.frame, this.state, silence);
    this.drawn += 1;
    Object.assign(canvas.dataset, { quality, x: x.toFixed(1), y: y.toFixed(1), drawn: this.drawn, frame: this.frame?.n ?? "", made: this.frame?.now ?? "" });
  }
}
