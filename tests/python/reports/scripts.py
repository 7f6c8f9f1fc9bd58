"""What is asked of an open report: scripts that run in the page."""

from __future__ import annotations

#: Dots of readings of a figure that are shown: each is a short stroke.
VISIBLE_POINTS = """(id) => [...document.getElementById(id).querySelectorAll("path[data-run]")]
  .filter((e) => e.checkVisibility())
  .reduce((n, e) => n + (e.getAttribute("d").match(/h[01]|l2 2/g) || []).length, 0)"""
#: What a box shows: the part of its square.
VIEW = """(id) => document.getElementById(id).querySelector(".box svg").getAttribute("viewBox")
  .split(" ").map(Number)"""

#: Texts within charts: their count, and pairs that overlap.
TEXTS_WITHIN = """() => { const clashes = []; let texts = 0;
    for (const axes of document.querySelectorAll(".axes")) {
      const boxes = [...axes.querySelectorAll("span")]
        .filter((e) => getComputedStyle(e).visibility !== "hidden")
        .map((e) => [e.textContent, e.getBoundingClientRect()])
        .filter(([text, r]) => text.trim() && r.width && r.height);
      texts += boxes.length;
      for (const [i, [a, p]] of boxes.entries()) for (const [b, q] of boxes.slice(i + 1))
        if (Math.min(p.right, q.right) - Math.max(p.left, q.left) > 1
            && Math.min(p.bottom, q.bottom) - Math.max(p.top, q.top) > 3)
          clashes.push(`${axes.closest(".plot").id}: ${a} / ${b}`); }
    return [texts, clashes]; }"""

#: Titles, legends and captions of figures that overlap.
TEXTS_AROUND = """() => { const found = [];
    for (const figure of document.querySelectorAll("figure")) {
      const texts = [...figure.querySelectorAll(
        "figcaption, .chart-title, .legend > span, .note, .box")]
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
    const light = (c) => { const v = c.match(/\\d+/g).slice(0, 3).map((x) => x / 255)
      .map((x) => x <= 0.03928 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);
      return 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2]; };
    const back = light(getComputedStyle(document.body).backgroundColor), found = {};
    for (const path of document.querySelectorAll(".box path:not(.grid)")) {
      if (path.getAttribute("style").includes("--back")) continue;
      const shade = getComputedStyle(path).stroke;
      if (shade === "none") continue;
      const l = light(shade);
      found[shade] = (Math.max(l, back) + 0.05) / (Math.min(l, back) + 0.05); }
    return found; }"""

#: Cards whose numbers stick out, four of them side by side and one with two long numbers.
CARDS_BURST = """() => { const cards = document.querySelector(".cards");
  while (cards.children.length < 4) cards.append(cards.children[0].cloneNode(true));
  const big = cards.children[1].querySelector(".big");
  big.className = "big pair"; big.textContent = "0.3967 \u2192 0.0810";
  return [...cards.children].filter((card) => { const range = document.createRange();
    range.selectNodeContents(card);
    return range.getBoundingClientRect().right > card.getBoundingClientRect().right; })
    .map((card) => card.textContent); }"""
