"use strict";
(() => {
  const root = document.documentElement, every = (what, of = document) => [...of.querySelectorAll(what)];
  const dark = matchMedia("(prefers-color-scheme: dark)"), side = 10000;
  let chosen = null;   // a theme chosen by the button wins over the system's
  const theme = () => chosen || (dark.matches ? "dark" : "light");
  const paint = () => { root.dataset.theme = location.hash === "#print" ? "light" : theme(); };

  /* Zoom: the box shows a part of its square; numbers move with it, finer ones come between. */
  function zoomed(axes) {
    const box = axes.querySelector(".box"), svg = box.querySelector("svg"), read = box.appendChild(document.createElement("span"));
    const whole = [0, 0, side, side], texts = every(".x span, .y span, .name", axes).map((s) => [s, parseFloat(s.style.left) / 100, parseFloat(s.style.bottom) / 100]);
    const ends = [axes.dataset.x, axes.dataset.y].map((text) => text && text.split(" ").map(Number));
    let view = whole;
    read.className = "read";
    const value = (i, part) => ends[i][0] + (ends[i][1] - ends[i][0]) * part;
    function show(next) {
      view = next;
      svg.setAttribute("viewBox", view.join(" "));
      every(".fine", axes).forEach((s) => s.remove());
      const [x, y, w, h] = view.map((v) => v / side), low = 1 - y - h, full = w === 1 && h === 1;
      const inside = (part) => part >= -1e-6 && part <= 1 + 1e-6;
      for (const [span, left, bottom] of texts) {
        const at = [(left - x) / w, (bottom - low) / h], own = !full && (span.closest(".x") && ends[0] || span.closest(".y") && ends[1]);
        span.hidden = Boolean(own) || at.some((part) => !Number.isNaN(part) && !inside(part));
        if (!Number.isNaN(left)) span.style.left = `${100 * at[0]}%`;
        if (!Number.isNaN(bottom)) span.style.bottom = `${100 * at[1]}%`;
      }
      if (!full) [[0, x, w, ".x", "left"], [1, low, h, ".y", "bottom"]].forEach(([i, from, width, where, edge]) => {
        if (!ends[i]) return;
        const a = value(i, from), b = value(i, from + width), size = 10 ** Math.floor(Math.log10(Math.abs(b - a) / 5));
        const step = [1, 2, 5, 10].map((m) => m * size).find((s) => Math.abs(b - a) / s <= 6), digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
        for (let k = Math.ceil(Math.min(a, b) / step); k * step <= Math.max(a, b); k++) {
          const span = axes.querySelector(where).appendChild(document.createElement("span"));
          span.className = "fine"; span.textContent = (k * step).toFixed(digits).replace("-", "\u2212"); span.style[edge] = `${(100 * (k * step - a)) / (b - a)}%`;
        }
      });
    }
    const place = (e) => { const r = box.getBoundingClientRect(); return [(e.clientX - r.left) / r.width, (e.clientY - r.top) / r.height].map((p) => Math.min(Math.max(p, 0), 1)); };
    const about = (p) => [view[0] + p[0] * view[2], view[1] + p[1] * view[3]];
    let from = null, frame = null;
    box.addEventListener("pointerdown", (e) => { if (e.pointerType === "mouse" && e.button === 0) { from = about(place(e)); box.setPointerCapture(e.pointerId); e.preventDefault(); axes.closest(".plot").focus({ preventScroll: true }); } });
    box.addEventListener("pointermove", (e) => {
      const at = about(place(e));
      read.textContent = ends.some((end) => !end) ? "" : [value(0, at[0] / side), value(1, 1 - at[1] / side)].map((v) => v.toPrecision(4)).join(", ");
      if (!from) return;
      frame = frame || svg.appendChild(document.createElementNS(svg.namespaceURI, "rect"));
      Object.entries({ x: Math.min(from[0], at[0]), y: Math.min(from[1], at[1]), width: Math.abs(at[0] - from[0]), height: Math.abs(at[1] - from[1]) }).forEach(([k, v]) => frame.setAttribute(k, v));
    });
    box.addEventListener("pointerup", () => {
      if (frame) { const next = ["x", "y", "width", "height"].map((k) => Number(frame.getAttribute(k))); if (next[2] > 0.02 * view[2] && next[3] > 0.02 * view[3]) show(next); frame.remove(); }
      from = frame = null;
    });
    box.addEventListener("pointerleave", () => { read.textContent = ""; });
    box.addEventListener("dblclick", () => show(whole));
    return (key) => {
      const move = { ArrowLeft: -0.1, ArrowRight: 0.1 }[key], zoom = { "+": 0.7, "=": 0.7, "-": 1 / 0.7 }[key];
      const w = Math.min(side, view[2] * (zoom || 1)), x = view[0] + (view[2] - w) / 2 + (move || 0) * view[2];
      if (move || zoom) show([Math.min(Math.max(x, 0), side - w), view[1], w, w === side ? side : view[3]].map((v, i) => (w === side && i === 1 ? 0 : v)));
      else if (key === "0") show(whole);
      else return false;
      return true;
    };
  }

  /* Runs whose boxes are not ticked are hidden in every figure. */
  const hiding = document.head.appendChild(document.createElement("style"));
  function hide() {
    hiding.textContent = every(".run-toggle:not(:checked)").map((b) => `path[data-run="${b.dataset.run}"] { display: none; }`).join("");
  }

  /* Texts that would meet others on a narrow screen: of numbers and of names the first stays. */
  function thin() {
    for (const some of every(".axes .x, .axes .box")) {
      const kept = [];
      for (const span of every("span:not(.read)", some)) {
        span.style.visibility = "";
        const r = span.getBoundingClientRect();
        const meets = kept.some((k) => r.left < k.right + 3 && k.left < r.right + 3 && r.top < k.bottom && k.top < r.bottom);
        if (meets) span.style.visibility = "hidden"; else kept.push(r);
      }
    }
  }

  const mark = () => every(".scroll").forEach((t) => t.classList.toggle("wide", t.scrollWidth > t.clientWidth + 1));
  const signal = document.getElementById("signal");
  const choose = () => every("option", signal).forEach((o) => { document.getElementById(o.value).hidden = o.value !== signal.value; });
  let closed = [];
  const unfold = () => { root.dataset.theme = "light"; closed = every("details:not([open])"); closed.forEach((d) => { d.open = true; }); };

  paint(); mark(); thin();
  if (location.hash === "#print") unfold();
  addEventListener("beforeprint", unfold);
  addEventListener("afterprint", () => { closed.forEach((d) => { d.open = false; }); paint(); });
  addEventListener("resize", () => { mark(); thin(); });
  every("details").forEach((d) => d.addEventListener("toggle", () => { mark(); thin(); }));
  dark.addEventListener("change", paint);
  document.getElementById("theme").addEventListener("click", () => { chosen = theme() === "dark" ? "light" : "dark"; paint(); });
  every(".run-toggle").forEach((b) => b.addEventListener("change", hide));
  if (signal) { choose(); signal.addEventListener("change", choose); }
  for (const plot of every(".plot")) {
    const keys = every(".axes", plot).map(zoomed);
    plot.addEventListener("keydown", (e) => { if (keys.length && keys[0](e.key)) e.preventDefault(); });
  }
  // A link to a section unfolds what answers it.
  every("nav a").forEach((link) => link.addEventListener("click", () => {
    const first = document.querySelector(link.hash).closest("section").querySelector("details");
    if (first) first.open = true;
  }));
  root.dataset.ready = "true";
})();
