// The last 30 s of every signal: for each bin of time the least and the largest value.

const GAP = 8; // empty bins that are drawn over: estimates come less often than bins

class Channel {
  constructor(size) {
    this.size = size;
    this.low = new Float32Array(size).fill(NaN);
    this.high = new Float32Array(size).fill(NaN);
    this.last = -1; // number of the newest bin
  }

  take(first, low, high) {
    for (let k = 0; k < low.length; k++) {
      const number = first + k;
      for (let empty = Math.max(this.last + 1, number - this.size); empty < number; empty++) this.set(empty, null, null);
      this.set(number, low[k], high[k]);
      this.last = Math.max(this.last, number);
    }
  }

  set(number, low, high) {
    const place = number % this.size;
    this.low[place] = low ?? NaN;
    this.high[place] = high ?? NaN;
  }
}

export class Traces {
  // rows: [{title, unit, group, names: [name, ...], colours: [...], marks: (state) => [values], needed: (state) => whether an empty row is shown}]
  constructor(canvas, rows, window = 30) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.rows = rows.map((row) => ({ ...row, range: null }));
    this.window = window;
    this.channels = {};
    this.widths = {};
    this.now = null;
    this.state = null;
    this.requested = false;
    new ResizeObserver(() => this.fit()).observe(canvas);
  }

  fit() {
    const ratio = window.devicePixelRatio || 1;
    this.canvas.width = Math.round(this.canvas.clientWidth * ratio);
    this.canvas.height = Math.round(this.canvas.clientHeight * ratio);
    this.request();
  }

  // All bins come anew after a lost connection.
  forget() {
    this.channels = {};
  }

  take(message) {
    Object.assign(this.widths, message.widths);
    for (const [group, bins] of Object.entries(message.groups)) {
      const size = Math.round(this.window / message.widths[group]);
      for (const name of Object.keys(bins.low)) {
        const channel = (this.channels[`${group}.${name}`] ??= new Channel(size));
        channel.take(bins.first, bins.low[name], bins.high[name]);
      }
    }
    this.request();
  }

  request() {
    if (this.requested) return;
    this.requested = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.requested = false;
    const { canvas, context } = this, ratio = window.devicePixelRatio || 1;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    context.clearRect(0, 0, width, height);
    const left = 92, right = width - 12, bottom = height - 22;
    const rows = this.rows.filter((row) => this.holds(row) || !this.state || (row.needed?.(this.state) ?? true));
    const tall = bottom / rows.length;
    rows.forEach((row, index) => this.drawRow(row, left, index * tall, right - left, tall));
    context.fillStyle = "#9aa7b5";
    context.font = '11px "Inter", "DejaVu Sans", system-ui, sans-serif';
    context.textBaseline = "top";
    context.textAlign = "center";
    for (let s = 0; s <= this.window; s += 5) context.fillText(`−${this.window - s} s`.replace("−0 s", "now"), left + ((right - left) * s) / this.window, bottom + 5);
  }

  // Whether anything of a row has come.
  holds({ group, names }) {
    return names.some((name) => this.channels[`${group}.${name}`]?.last >= 0);
  }

  drawRow(row, left, top, width, tall) {
    const { context } = this;
    const inner = { top: top + 9, bottom: top + tall - 7 };
    context.strokeStyle = "#212a35";
    context.lineWidth = 1;
    context.beginPath();
    for (let s = 0; s <= this.window; s += 5) {
      const x = Math.round(left + (width * s) / this.window) + 0.5;
      context.moveTo(x, top + 4);
      context.lineTo(x, top + tall - 4);
    }
    context.moveTo(left, Math.round(top + tall) - 0.5);
    context.lineTo(left + width, Math.round(top + tall) - 0.5);
    context.stroke();
    const channels = row.names.map((name) => this.channels[`${row.group}.${name}`]);
    const shown = channels.map((channel) => channel && this.columns(row, channel, left, width));
    const marks = (this.state && row.marks?.(this.state)) ?? [];
    this.fitRange(row, shown, marks);
    this.drawName(row, top, tall, shown);
    if (!row.range) {
      context.fillStyle = "#6c7885";
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.font = '12px "Inter", "DejaVu Sans", system-ui, sans-serif';
      context.fillText(row.absent ?? "nothing yet", left + width / 2, top + tall / 2);
      return;
    }
    const [low, high] = row.range;
    const y = (value) => inner.bottom - ((inner.bottom - inner.top) * (value - low)) / (high - low);
    context.setLineDash([5, 4]);
    context.strokeStyle = "#56b4e9";
    for (const value of marks) {
      context.beginPath();
      context.moveTo(left, y(value));
      context.lineTo(left + width, y(value));
      context.stroke();
    }
    context.setLineDash([]);
    shown.forEach((columns, index) => columns && this.drawColumns(columns, y, row.colours[index]));
    context.fillStyle = "#6c7885";
    context.font = '10px "Inter", "DejaVu Sans", system-ui, sans-serif';
    context.textAlign = "right";
    context.textBaseline = "top";
    context.fillText(nice(high), left - 5, inner.top - 4);
    context.textBaseline = "bottom";
    context.fillText(nice(low), left - 5, inner.bottom + 5);
  }

  // Bins as [x, low, high] with null where the line breaks off.
  columns(row, channel, left, width) {
    const bin = this.widths[row.group];
    const found = [];
    let empty = GAP + 1;
    for (let number = channel.last - channel.size + 1; number <= channel.last; number++) {
      const x = left + width * (1 - (this.now - (number + 0.5) * bin) / this.window);
      const place = ((number % channel.size) + channel.size) % channel.size;
      const low = channel.low[place];
      if (Number.isNaN(low) || x < left) {
        empty += 1;
        continue;
      }
      if (empty > GAP && found.length) found.push(null);
      empty = 0;
      if (x <= left + width) found.push([x, low, channel.high[place]]);
    }
    return found;
  }

  // A range that grows at once and shrinks only when the signal fills less than half of it, so that the picture is calm.
  fitRange(row, shown, marks) {
    let low = Infinity, high = -Infinity;
    for (const columns of shown) {
      for (const column of columns ?? []) {
        if (!column) continue;
        low = Math.min(low, column[1]);
        high = Math.max(high, column[2]);
      }
    }
    if (!(low <= high)) {
      row.range = null;
      return;
    }
    for (const value of marks) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
    if (row.zero) low = Math.min(low, 0);
    const least = row.least ?? 1e-6;
    if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
    const room = 0.06 * (high - low), now = row.range;
    const tooSmall = now && (low < now[0] || high > now[1]), tooLarge = now && high - low < 0.5 * (now[1] - now[0]);
    if (!now || tooSmall || tooLarge) row.range = [low - (row.zero && low === 0 ? 0 : room), high + 2 * room];
  }

  drawName(row, top, tall, shown) {
    const { context } = this;
    context.textAlign = "left";
    context.textBaseline = "middle";
    context.font = '600 13px "Inter", "DejaVu Sans", system-ui, sans-serif';
    const middle = top + tall / 2;
    context.fillStyle = row.colours[0];
    context.fillText(row.title, 4, middle - 8);
    context.fillStyle = "#9aa7b5";
    context.font = '11px "Inter", "DejaVu Sans", system-ui, sans-serif';
    context.fillText(row.unit, 4, middle + 8);
    const last = row.value && shown[0]?.findLast((column) => column);
    if (!last) return;
    context.fillStyle = row.colours[0];
    context.font = '600 15px "Inter", "DejaVu Sans", system-ui, sans-serif';
    context.fillText(nice(last[2]), 4, middle - 26);
  }

  drawColumns(columns, y, colour) {
    const { context } = this;
    context.strokeStyle = colour;
    context.lineWidth = 1.3;
    context.lineJoin = "round";
    context.beginPath();
    let pen = false;
    for (const column of columns) {
      if (!column) {
        pen = false;
        continue;
      }
      const [x, low, high] = column;
      if (pen) context.lineTo(x, y(high));
      else context.moveTo(x, y(high));
      context.lineTo(x, y(low) + 0.5);
      pen = true;
    }
    context.stroke();
  }
}

function nice(value) {
  const size = Math.abs(value);
  return (size >= 100 ? value.toFixed(0) : size >= 10 ? value.toFixed(0) : value.toFixed(1)).replace("-", "−");
}
