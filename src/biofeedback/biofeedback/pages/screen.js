// The plot of the 2-D screen: torque upwards, feedback to the right, band, region and cursor. All words are beside it (view.js), so that no
// text can lie over another; with units (for the operator) numbers stand at the grid's lines.
//
// Sizes are parts of the plot's shorter side. Colours are Okabe and Ito's; whatever a colour says is also said by a shape or a word.

const BACKGROUND = "#10151c", GRID = "#2b3542", TEXT = "#f2f5f8", DIM = "#9aa7b5";
const SKY = "#56b4e9", GREEN = "#00b384", YELLOW = "#f0e442", ORANGE = "#e69f00", GREY = "#a8b0b8";
export const STALE = 0.5; // s without a frame after which this page itself says that nothing comes

// How the frame must be shown: its own quality, unless nothing has come for too long.
export function shownQuality(frame, silence) {
  if (silence > STALE) return "lost";
  if (!frame) return "waiting";
  if (frame.quality === "stale" || frame.torque_quality === "stale") return "stale";
  if (frame.quality === "waiting" || frame.torque_quality === "waiting") return "waiting";
  return frame.quality;
}

// Draws the plot. Returns {quality, plot, x, y}: the plot's rectangle and the cursor's place in pixels.
export function drawPlot(context, width, height, frame, state, silence, units) {
  context.fillStyle = BACKGROUND;
  context.fillRect(0, 0, width, height);
  const quality = shownQuality(frame, silence), size = Math.min(width, height);
  const ink = units ? Math.max(9 * (window.devicePixelRatio || 1), 0.045 * size) : 0;
  const edge = 0.01 * size + 1;
  const plot = { left: edge + 2.6 * ink, top: edge + 0.6 * ink, width: width - 2 * edge - 3.4 * ink, height: height - 2 * edge - 2.2 * ink };
  if (!state || plot.width < 2 || plot.height < 2) return { quality, plot, x: NaN, y: NaN };
  const to = scale(plot, state.axes);
  const running = state.session.state === "running" && state.session.kind !== "break";
  drawGrid(context, plot, size, to, state, ink);
  const inside = running && quality === "valid" && frame.in_target && state.session.kind !== "baseline";
  drawTargets(context, plot, size, to, state.target, running, inside);
  const doubtful = state.doubt !== "" && state.target.feedback !== "reflex";
  const place = running || quality !== "valid" ? drawCursor(context, plot, size, to, frame, quality, inside, doubtful) : { x: NaN, y: NaN };
  return { quality, plot, ...place };
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

function drawGrid(context, plot, size, to, state, ink) {
  const bottom = plot.top + plot.height, right = plot.left + plot.width;
  context.lineWidth = Math.max(1, 0.002 * size);
  context.strokeStyle = GRID;
  context.fillStyle = DIM;
  font(context, ink || 1, 500);
  context.textBaseline = "top";
  context.textAlign = "center";
  for (const value of ticks(...state.axes.x, ink ? Math.min(6, plot.width / (5 * ink)) : 6)) {
    line(context, to.x(value), plot.top, to.x(value), bottom);
    if (ink) context.fillText(label(value), to.x(value), bottom + 0.3 * ink);
  }
  context.textBaseline = "middle";
  context.textAlign = "right";
  for (const value of ticks(...state.axes.y, ink ? Math.min(6, plot.height / (2 * ink)) : 6)) {
    line(context, plot.left, to.y(value), right, to.y(value));
    if (ink) context.fillText(label(value), plot.left - 0.3 * ink, to.y(value));
  }
  context.strokeStyle = DIM;
  context.strokeRect(plot.left, plot.top, plot.width, plot.height);
  if (state.baseline) {
    const x = to.x(state.baseline[state.target.feedback]), wide = 0.022 * size;
    context.fillStyle = TEXT;
    polygon(context, [[x, bottom - wide], [x - wide, bottom + 0.2 * wide], [x + wide, bottom + 0.2 * wide]]);
    context.fill();
  }
}

function drawTargets(context, plot, size, to, target, running, inside) {
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
  context.lineWidth = 0.006 * size;
  line(context, plot.left, top, plot.left + plot.width, top);
  line(context, plot.left, bottom, plot.left + plot.width, bottom);
  if (target.lower !== null) {
    const left = to.x(target.lower), right = to.x(target.upper);
    context.globalAlpha = 0.16 * strong;
    context.fillStyle = GREEN;
    context.fillRect(left, plot.top, right - left, plot.height);
    context.globalAlpha = strong;
    context.strokeStyle = GREEN;
    context.setLineDash([0.022 * size, 0.014 * size]);
    line(context, left, plot.top, left, plot.top + plot.height);
    line(context, right, plot.top, right, plot.top + plot.height);
    context.setLineDash([]);
    goal(context, left, top, right, bottom, size, inside, strong);
  }
  context.restore();
}

// Where band and region cross: a filled field with corner brackets, a full frame once the cursor is in it.
function goal(context, left, top, right, bottom, size, inside, strong) {
  context.globalAlpha = (inside ? 0.34 : 0.16) * strong;
  context.fillStyle = YELLOW;
  context.fillRect(left, top, right - left, bottom - top);
  context.globalAlpha = strong;
  context.strokeStyle = YELLOW;
  context.lineWidth = 0.01 * size;
  context.lineJoin = "miter";
  if (inside) {
    context.strokeRect(left, top, right - left, bottom - top);
    return;
  }
  const dx = Math.min(0.05 * size, (right - left) / 3), dy = Math.min(0.05 * size, (bottom - top) / 3);
  for (const [x, y, sx, sy] of [[left, top, 1, 1], [right, top, -1, 1], [left, bottom, 1, -1], [right, bottom, -1, -1]]) {
    context.beginPath();
    context.moveTo(x + sx * dx, y);
    context.lineTo(x, y);
    context.lineTo(x, y + sy * dy);
    context.stroke();
  }
}

export function clock(seconds) {
  const whole = Math.ceil(seconds);
  return whole < 100 ? `${whole} s` : `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function drawCursor(context, plot, size, to, frame, quality, inside, doubtful) {
  if (!frame) return { x: NaN, y: NaN };
  const radius = 0.034 * size;
  const known = { x: frame.x !== null, y: frame.y !== null };
  const wanted = { x: known.x ? to.x(frame.x) : plot.left + plot.width / 2, y: known.y ? to.y(frame.y) : plot.top + plot.height / 2 };
  const x = Math.min(Math.max(wanted.x, plot.left + radius), plot.left + plot.width - radius);
  const y = Math.min(Math.max(wanted.y, plot.top + radius), plot.top + plot.height - radius);
  context.globalAlpha = 1;
  if (quality === "valid") {
    solidCursor(context, x, y, radius, size, inside, doubtful);
    const beyond = [wanted.x - x, wanted.y - y];
    if (Math.hypot(...beyond) > radius) arrow(context, x, y, radius, Math.atan2(beyond[1], beyond[0]));
  } else {
    if (frame.torque_quality === "valid") torqueLine(context, plot, size, y);
    hollowCursor(context, x, y, 1.15 * radius, size);
  }
  return { x, y };
}

// A doubtful value has a dashed rim: it may be off by more than its error.
function solidCursor(context, x, y, radius, size, inside, doubtful) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = inside ? GREEN : ORANGE;
  context.fill();
  context.lineWidth = 0.007 * size;
  context.strokeStyle = "#ffffff";
  context.setLineDash(doubtful ? [0.35 * radius, 0.35 * radius] : []);
  context.stroke();
  context.setLineDash([]);
  if (!inside) return;
  context.lineWidth = 0.011 * size;
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

function hollowCursor(context, x, y, radius, size) {
  context.save();
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.save();
  context.clip();
  context.strokeStyle = GREY;
  context.lineWidth = 0.0035 * size;
  for (let offset = -2 * radius; offset < 2 * radius; offset += 0.014 * size) {
    line(context, x + offset - radius, y + radius, x + offset + radius, y - radius);
  }
  context.restore();
  context.setLineDash([0.018 * size, 0.012 * size]);
  context.lineWidth = 0.008 * size;
  context.strokeStyle = GREY;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.stroke();
  context.restore();
}

function torqueLine(context, plot, size, y) {
  context.save();
  context.setLineDash([0.03 * size, 0.02 * size]);
  context.lineWidth = 0.004 * size;
  context.strokeStyle = GREY;
  line(context, plot.left, y, plot.left + plot.width, y);
  context.restore();
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
  constructor(canvas, units = false) {
    this.canvas = canvas;
    this.units = units;
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
    const { quality, plot, x, y } = drawPlot(this.context, canvas.width, canvas.height, this.frame, this.state, silence, this.units);
    this.drawn += 1;
    Object.assign(canvas.dataset, { quality, x: x.toFixed(1), y: y.toFixed(1), drawn: this.drawn, frame: this.frame?.n ?? "", made: this.frame?.now ?? "" });
    canvas.dataset.plot = [plot.left, plot.top, plot.width, plot.height].map((value) => value.toFixed(1)).join(" ");
  }
}
