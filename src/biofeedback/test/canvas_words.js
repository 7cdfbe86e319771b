// Lets every canvas remember the words that were drawn on it since it was last cleared or painted over, for layout_check.js.
{
  const drawing = CanvasRenderingContext2D.prototype;
  const { clearRect, fillRect, fillText } = drawing;
  drawing.clearRect = function (...rectangle) {
    this.canvas.words = [];
    return clearRect.apply(this, rectangle);
  };
  drawing.fillRect = function (x, y, width, height) {
    if (x === 0 && y === 0 && width >= this.canvas.width && height >= this.canvas.height) this.canvas.words = [];
    return fillRect.call(this, x, y, width, height);
  };
  drawing.fillText = function (text, x, y, ...most) {
    const size = this.measureText(text), ratio = window.devicePixelRatio || 1;
    const corners = [[-size.actualBoundingBoxLeft, -size.actualBoundingBoxAscent], [size.actualBoundingBoxRight, size.actualBoundingBoxDescent]]
      .map(([across, down]) => this.getTransform().transformPoint(new DOMPoint(x + across, y + down)));
    const [across, down] = ["x", "y"].map((key) => corners.map((corner) => corner[key] / ratio));
    (this.canvas.words ??= []).push({ text: String(text), left: Math.min(...across), right: Math.max(...across), top: Math.min(...down), bottom: Math.max(...down) });
    return fillText.call(this, text, x, y, ...most);
  };
}
