// What is wrong with the layout of this page: words over one another, words that are cut, words beyond the window.
() => {
  const found = [], boxes = [];
  const seen = (element) => element.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  // The part of a rectangle that its clipping ancestors leave, and whether they cut it sideways (lists scroll up and down, wide tables of reports sideways).
  const clip = (element, rect) => {
    let { left, right, top, bottom } = rect, cut = false;
    for (let one = element; one && one !== document.body; one = one.parentElement) {
      const style = getComputedStyle(one);
      if (style.overflowX === "visible" && style.overflowY === "visible") continue;
      const edge = one.getBoundingClientRect();
      if (!one.classList.contains("wide") && (left < edge.left - 1 || right > edge.right + 1)) cut = true;
      if (style.overflowY === "hidden" && (top < edge.top - 1 || bottom > edge.bottom + 1)) cut = true;
      left = Math.max(left, edge.left); right = Math.min(right, edge.right);
      top = Math.max(top, edge.top); bottom = Math.min(bottom, edge.bottom);
    }
    return { left, right, top, bottom, cut };
  };
  const note = (element, rect, text) => {
    if (rect.width < 1 || rect.height < 1) return;
    const shown = clip(element, rect);
    if (shown.right - shown.left < 1 || shown.bottom - shown.top < 1) {
      if (shown.cut) found.push(`hidden: ${text}`);
      return;
    }
    if (shown.cut) found.push(`cut: ${text}`);
    if (shown.left < -1 || shown.right > innerWidth + 1) found.push(`beyond the window: ${text}`);
    boxes.push({ element, text, ...shown });
  };
  for (const element of document.body.querySelectorAll("*")) {
    if (!seen(element) || ["SCRIPT", "STYLE", "OPTION"].includes(element.tagName)) continue;
    for (const node of element.childNodes) {
      if (node.nodeType !== Node.TEXT_NODE || !node.textContent.trim()) continue;
      const range = document.createRange();
      range.selectNodeContents(node);
      for (const rect of range.getClientRects()) note(element, rect, node.textContent.trim().slice(0, 40));
    }
    // A report's curves lie below the words of their axes.
    if (["INPUT", "SELECT", "CANVAS"].includes(element.tagName) && !element.closest(".js-plotly-plot")) note(element, element.getBoundingClientRect(), `<${element.tagName.toLowerCase()} ${element.name ?? element.id}>`);
    const origin = element.getBoundingClientRect();
    for (const word of element.words ?? []) {
      const edge = { left: origin.left + word.left, right: origin.left + word.right, top: origin.top + word.top, bottom: origin.top + word.bottom };
      if (word.left < -1 || word.top < -1 || edge.right > origin.right + 1 || edge.bottom > origin.bottom + 1) found.push(`cut: ${word.text}`);
      boxes.push({ element, word, text: word.text, ...edge });
    }
    if (element.tagName === "INPUT" && element.type === "number" && element.scrollWidth > element.clientWidth + 1) found.push(`cut value: ${element.name}`);
  }
  const sticky = document.querySelector(".motion");
  boxes.forEach((one, k) => boxes.slice(k + 1).forEach((other) => {
    if ((one.element === other.element && !(one.word && other.word)) || (sticky && sticky.contains(one.element) !== sticky.contains(other.element))) return;
    const wide = Math.min(one.right, other.right) - Math.max(one.left, other.left);
    const tall = Math.min(one.bottom, other.bottom) - Math.max(one.top, other.top);
    if (wide > 1.5 && tall > 1.5) found.push(`over one another: ${one.text} | ${other.text}`);
  }));
  if (document.documentElement.scrollWidth > innerWidth + 1) found.push(`the page is ${document.documentElement.scrollWidth} wide in a window of ${innerWidth}`);
  return [...new Set(found)];
}
