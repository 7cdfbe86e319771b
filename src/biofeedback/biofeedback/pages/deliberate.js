// Acts that move a subject's foot, or end a hold, must be meant: a button that is held, or two keys that are held together.

export const HOLD_TIME = 1000; // ms; nobody rests a finger on a button for so long by accident, and a typed letter takes 100

// Calls `act` when the button was held for HOLD_TIME; shows the progress as the property --held (0 to 1) and says how when it is only clicked.
// Who holds it must not lose it because an alarm comes or goes and moves the page: the pointer is captured, and only one that leaves the place
// where the button was pressed ends the hold.
export class HeldButton {
  constructor(button, act, tooShort) {
    this.button = button;
    this.act = act;
    this.since = null;
    this.place = null; // the button's rectangle when the pointer went down
    button.classList.add("held");
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || button.disabled) return;
      this.place = button.getBoundingClientRect();
      button.setPointerCapture(event.pointerId);
      this.begin();
    });
    button.addEventListener("pointermove", ({ clientX: x, clientY: y }) => {
      if (this.place && (x < this.place.left || x > this.place.right || y < this.place.top || y > this.place.bottom)) this.cancel();
    });
    for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
      button.addEventListener(name, () => {
        if (this.since !== null && name === "pointerup") tooShort?.();
        this.cancel();
      });
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault()); // a long touch opens one
  }

  begin() {
    if (this.button.disabled || this.since !== null) return;
    this.since = performance.now();
    this.step();
  }

  step() {
    if (this.since === null) return;
    const part = (performance.now() - this.since) / HOLD_TIME;
    this.button.style.setProperty("--held", Math.min(part, 1));
    if (this.button.disabled) return this.cancel();
    if (part >= 1) {
      this.cancel();
      this.act();
      return;
    }
    setTimeout(() => this.step(), 30); // not requestAnimationFrame: it stands still in a page that is behind another
  }

  cancel() {
    this.since = this.place = null;
    this.button.style.removeProperty("--held");
  }
}

// Presses a HeldButton while Enter and its letter are held together.
export class Chords {
  // keys: {letter: HeldButton}
  constructor(keys) {
    this.keys = keys;
    this.down = new Set();
    addEventListener("keydown", (event) => this.press(event));
    addEventListener("keyup", (event) => this.release(event.key.toLowerCase()));
    addEventListener("blur", () => this.releaseAll());
  }

  press(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (["INPUT", "SELECT", "TEXTAREA"].includes(document.activeElement?.tagName)) return;
    this.down.add(event.key.toLowerCase());
    if (this.down.size !== 2 || !this.down.has("enter")) return this.cancelAll();
    const [letter] = [...this.down].filter((key) => key !== "enter");
    this.keys[letter]?.begin();
  }

  release(key) {
    this.down.delete(key);
    this.cancelAll();
  }

  releaseAll() {
    this.down.clear();
    this.cancelAll();
  }

  cancelAll() {
    Object.values(this.keys).forEach((button) => button.cancel());
  }
}
