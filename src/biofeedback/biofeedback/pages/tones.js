// Short tones, made here: nothing is loaded. A browser allows sound only after a key or a click on the page.

let context = null;

export function tone(frequency, seconds, volume = 0.15) {
  try {
    context ??= new AudioContext();
    const source = context.createOscillator(), gain = context.createGain();
    source.frequency.value = frequency;
    gain.gain.setValueAtTime(volume, context.currentTime);
    gain.gain.exponentialRampToValueAtTime(0.001, context.currentTime + seconds);
    source.connect(gain).connect(context.destination);
    source.start();
    source.stop(context.currentTime + seconds);
  } catch {
    // No sound device: everything that a tone says is also seen.
  }
}

export const hit = () => [660, 880].forEach((frequency, k) => setTimeout(() => tone(frequency, 0.15), 120 * k));
export const warning = () => [0, 1, 2].forEach((k) => setTimeout(() => tone(k % 2 ? 520 : 780, 0.25, 0.4), 250 * k));
