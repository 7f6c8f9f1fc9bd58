"""What is asked of an open report: scripts that run in the page."""

from __future__ import annotations

#: Views of the charts below an element; Bokeh keeps them by the id of their model.
CHARTS = """(id) => [...Bokeh.index].filter((view) => view.model.type === "Figure" &&
  document.getElementById(id).contains(view.el.getRootNode().host || view.el))"""
VISIBLE_POINTS = f"""(id) => ({CHARTS})(id).flatMap((view) => view.model.renderers)
  .filter((r) => r.visible && r.glyph && r.glyph.type === "Scatter")
  .reduce((n, r) => n + r.data_source.get_length(), 0)"""
X_RANGE = f"""(id) => {{ const r = ({CHARTS})(id)[0].model.x_range; return [r.start, r.end]; }}"""

#: Texts within charts, whose boxes are known where charts are vectors: their count, and
#: pairs that overlap.
TEXTS_WITHIN = """() => { const inside = (root) => [...root.querySelectorAll("*")].flatMap((e) =>
      [e, ...(e.shadowRoot ? inside(e.shadowRoot) : [])]);
    const clashes = []; let texts = 0;
    for (const canvas of document.querySelectorAll(".canvas")) {
      const boxes = inside(canvas).filter((e) => e.tagName === "text")
        .map((e) => [e.textContent, e.getBoundingClientRect()])
        .filter(([text, r]) => text.trim() && r.width && r.height);
      texts += boxes.length;
      // A layer that was painted again holds the same text at the same place.
      const same = ([a, p], [b, q]) => a === b && Math.abs(p.left - q.left) < 1
        && Math.abs(p.top - q.top) < 1;
      for (const [i, one] of boxes.entries()) for (const other of boxes.slice(i + 1)) {
        const [[a, p], [b, q]] = [one, other];
        if (!same(one, other) && Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1
            && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 3)
          clashes.push(`${canvas.closest(".plot").id}: ${a} / ${b}`); } }
    return [texts, clashes]; }"""

#: Titles, legends and captions of figures that overlap.
TEXTS_AROUND = """() => { const found = [];
    for (const figure of document.querySelectorAll("figure")) {
      const texts = [...figure.querySelectorAll(
        "figcaption, .chart-title, .legend > span, .note, .canvas")]
        .map((e) => [e, e.getBoundingClientRect()]).filter(([, r]) => r.width && r.height);
      for (const [i, [a, p]] of texts.entries()) for (const [b, q] of texts.slice(i + 1)) {
        const over = Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1
          && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 1;
        if (over && !a.contains(b) && !b.contains(a))
          found.push([a.outerHTML.slice(0, 60), b.outerHTML.slice(0, 60)]); } }
    return found; }"""

#: What sticks out of the page and no hint says so.
OUT_OF_REACH = """() => [...document.querySelectorAll("body *")].filter((e) => {
    const r = e.getBoundingClientRect();
    if (!r.width || !r.height || r.right <= innerWidth + 1 || r.left < 0) return false;
    const frame = e.closest(".scroll, pre");
    if (!frame || frame.getBoundingClientRect().right > innerWidth + 1) return true;
    return frame.matches(".scroll")
      && getComputedStyle(frame.querySelector(".hint")).display === "none"; })
    .map((e) => e.outerHTML.slice(0, 80))"""

#: Contrast of every colour of points and lines with the page.
CONTRASTS = """() => {
    const light = (hex) => { const v = [1, 3, 5]
      .map((i) => parseInt(hex.slice(i, i + 2), 16) / 255)
      .map((x) => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
      return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
    const root = getComputedStyle(document.documentElement);
    const back = light(root.getPropertyValue("--back").trim());
    const found = {};
    for (const view of Bokeh.index) for (const r of view.model.renderers || []) {
      const shade = r.glyph && r.glyph.line_color && r.glyph.line_color.value;
      if (!shade) continue;
      const l = light(shade);
      found[shade] = (Math.max(l, back) + 0.05) / (Math.min(l, back) + 0.05); }
    return found; }"""

#: Neighbouring numbers of upright axes whose texts would touch, in pixels of the screen.
NUMBERS_APART = """() => { const found = []; let axes = 0;
  for (const view of Bokeh.index) {
    if (view.model.type !== "Figure") continue;
    for (const axis of view.model.below) {
      const ticks = axis.ticker.ticks;
      if (!ticks) continue;
      axes += 1;
      const at = ticks.map((t) => [String(t), view.frame.x_scale.compute(t)]);
      for (let i = 1; i < at.length; i++) {
        const room = 3 * (at[i][0].length + at[i - 1][0].length);
        if (at[i][1] - at[i - 1][1] < room) found.push(`${at[i - 1][0]} ${at[i][0]}`); } } }
  return [axes, found]; }"""

#: Cards whose numbers stick out, four of them side by side and one with two long numbers.
CARDS_BURST = """() => { const cards = document.querySelector(".cards");
  while (cards.children.length < 4) cards.append(cards.children[0].cloneNode(true));
  const big = cards.children[1].querySelector(".big");
  big.className = "big pair"; big.textContent = "0.3967 \u2192 0.0810";
  return [...cards.children].filter((card) => { const range = document.createRange();
    range.selectNodeContents(card);
    return range.getBoundingClientRect().right > card.getBoundingClientRect().right; })
    .map((card) => card.textContent); }"""
