// A view of the subject's screen that is fed by hand, with the texts that a test asks for.
async ([language, instruction, hint, quality, hold]) => {
  const { View } = await import('/pages/view.js');
  if (!window.fed) {
    document.getElementById('view').remove();
    const place = document.createElement('main');
    document.body.append(place);
    window.fed = new View(place, { id: 'fed', silence: () => window.silence, language });
  }
  if (window.fed.language !== language) { window.fed.language = language; await window.fed.load(language); }
  window.silence = quality === 'lost' ? 9 : 0;
  const running = ['relax', 'reach', 'hold'].includes(instruction);
  window.fed.frame({ n: 1, now: 1, x: 8, y: 0.2, quality: quality === 'lost' ? 'valid' : quality, torque_quality: 'valid',
                      in_target: hold, hint, elapsed: 30, remaining: 3599, clock: 60 });
  window.fed.state({ language, axes: { x: [0, 18], y: [-9, 4] }, baseline: { K: 80, G: 8, torque: 0 },
    target: { feedback: hold ? 'K' : 'G', unit: 'N.m/rad', torque: -5, torque_half_width: 1, lower: 5, upper: 7 },
    session: { state: running ? 'running' : 'idle', kind: instruction === 'break' ? 'break' : 'hold', instruction, block: 12, blocks: 12,
               hold: 120, holds: 120, holds_done: 120, hits: 119, duration: 60 } });
  await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)));
}
